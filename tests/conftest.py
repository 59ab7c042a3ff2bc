"""Two processes run the tests: each keeps to one core."""

import os

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ.setdefault(f'{library}_NUM_THREADS', '1')
