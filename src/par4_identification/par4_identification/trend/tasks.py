"""Bags as independent tasks on dask: on the cores of this process, or on a cluster."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import resource_tracker
from typing import Any

from par4_identification.diagnosis.evidence.side_by_side import processors
from par4_kinematics.errors import InputError
from par4_kinematics.held_signals import held_back

FEW = 4
"""Bags up to which starting workers takes longer than they save."""
REACHED = 10
"""s in which a scheduler must answer."""
FREE_PORT = ':0'
"""For the page of the workers: the usual one may be in use, which dask would warn of."""
ONE_THREAD = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS')


def results_of(work: Callable[[str], dict[str, Any]], bags: Sequence[str], scheduler: str | None
               ) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each bag with what was made of it, as it comes.

    Args:
        work: of one bag; must not raise.
        bags: paths, which the workers must see alike.
        scheduler: address of a dask scheduler; None for the cores of this machine.

    Raises:
        InputError: no scheduler answers, it has no workers, or it ends before the bags do.
    """
    if scheduler is None and len(bags) <= FEW:
        yield from ((bag, work(bag)) for bag in bags)
        return
    from dask.distributed import Client, LocalCluster, as_completed  # slow to load

    # what it says of lost connections is said here in a line
    logging.getLogger('distributed.client').setLevel(logging.CRITICAL)
    cluster = None
    if scheduler is None:
        for name in ONE_THREAD:  # workers inherit it: they must not fight for the cores
            os.environ.setdefault(name, '1')
        resource_tracker.ensure_running()
        with held_back(signal.SIGINT):  # Ctrl-C is for this process, which ends the others
            cluster = LocalCluster(
                threads_per_worker=1, n_workers=min(len(bags), processors()),
                dashboard_address=FREE_PORT, silence_logs=logging.ERROR)
    try:
        try:
            client = Client(cluster or scheduler, timeout=REACHED)
        except (OSError, ValueError, TimeoutError) as error:
            raise _refusal(scheduler, 'no dask scheduler answers there; give an address as '
                                      'tcp://HOST:8786, or leave it out') from error
        with client:
            try:
                client.wait_for_workers(1, timeout=REACHED)
            except TimeoutError as error:
                raise _refusal(scheduler, f'it has no workers; start some with `dask worker '
                                          f'{scheduler} --nthreads 1`') from error
            futures = {client.submit(work, bag, pure=False): bag for bag in bags}
            for future in as_completed(futures):
                if future.cancelled():
                    raise _refusal(scheduler, 'the connection to it was lost; the bags done so '
                                              'far are kept, so call again')
                lost = future.exception()
                outcome = future.result() if lost is None else {
                    'error': f'{futures[future]}: its task was lost ({type(lost).__name__})'}
                future.release()  # a worker that is lost would have its work done again
                yield futures[future], outcome
    finally:
        if cluster is not None:
            cluster.close()


def _refusal(scheduler: str | None, fault: str) -> InputError:
    """Return the error of a scheduler that was asked for, else of the workers of this machine."""
    return InputError(
        'the workers on this machine do not answer; the bags done so far are kept, so end what '
        'else is busy here and call again' if scheduler is None else
        f'--scheduler {scheduler}: {fault}')
