"""A year in the life of a machine: seasons, wear, a repair, a payload; drawn from a seed.

What happens to the machine is written as its parameters over time, once for simulated estimates and
once for simulated bags.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model_file import ModelFile, read_model_file
from par4_identification.trend.bag_values import BagValues

NAMES = tuple(term.name for term in BASE_TERMS)
COULOMB, VISCOUS = NAMES.index('coulomb_friction'), NAMES.index('viscous_friction')
BEGIN = 1_767_225_600
"""s since 1970: 1 January 2026."""
YEAR = 365.25
SEASON, WEATHER = 8.0, 1.5
"""K: amplitude of the temperature over the year, and its scatter from bag to bag."""
DRY, FLOWING = -0.002, -0.007
"""Change of Coulomb and viscous friction with temperature, 1/K."""


@dataclass(frozen=True)
class Happened:
    """What is done to the machine, or begins with it.

    Attributes:
        what: 'wear', 'repair', 'payload', 'unloaded', 'grease'.
        day: since the beginning.
    """

    what: str
    day: float


@dataclass(frozen=True)
class Year:
    """The machine's parameters at each bag.

    Attributes:
        t: days of the bags, (n,).
        values: (n, 4, 6).
        happened: in order of time.
        joint: that wears.
        rate: of its viscous friction, 1/week.
    """

    t: np.ndarray
    values: np.ndarray
    happened: tuple[Happened, ...]
    joint: int
    rate: float

    def bags(self, covariance: np.ndarray, random: np.random.Generator) -> list[BagValues]:
        """Return estimates from bags with a covariance (24, 24) at TABLE 1.

        The deviations of friction and masses grow with them, as a wrong torque does.
        """
        root = np.linalg.cholesky(covariance)
        found = []
        for number, (day, values) in enumerate(zip(self.t, self.values)):
            estimate = values + (root @ random.normal(size=24)).reshape(4, 6)
            found.append(BagValues(f'bag {number}', round((BEGIN + 86400.0 * day) * 1e9), 20.0,
                                   NAMES, estimate, covariance))
        return found

    def model_file(self, number: int, rigid_body: str = 'full') -> ModelFile:
        """Return the machine at a bag as `par4_simulate` takes it."""
        content = read_model_file('table1_full' if rigid_body == 'full' else 'table1')
        parameters = {}
        for index, name in enumerate(NAMES):
            own = self.values[number, :, index]
            value = float(own[0]) if name.startswith('platform') else tuple(map(float, own))
            parameters[name] = content.parameters[name].model_copy(
                update={'value': value, 'std': None})
        return content.model_copy(update={'parameters': parameters})


def drawn_year(seed: int, bags: int = 200, eventful: bool = True) -> Year:
    """Return a year in which things happen, or in which only the seasons go on."""
    random = np.random.default_rng((seed, 365))
    t = np.sort(random.uniform(0.0, YEAR, bags))
    table = read_model_file('table1').parameters
    values = np.tile([float(np.mean(table[name].value)) for name in NAMES], (bags, 4, 1))
    joint, rate = int(random.integers(4)), float(random.uniform(0.01, 0.03))
    happened: list[Happened] = []
    if eventful:
        wear, payload = random.uniform(0.1, 0.4) * YEAR, random.uniform(0.1, 0.9) * YEAR
        repair = wear + random.uniform(0.2, 0.4) * YEAR
        unloaded = payload + random.uniform(0.05, 0.3) * YEAR
        happened = [Happened('wear', wear), Happened('repair', repair),
                    Happened('payload', payload), Happened('unloaded', unloaded)]
        worn = (t >= wear) & (t < repair)
        values[worn, joint, VISCOUS] *= 1.0 + rate * (t[worn] - wear)[:] / 7.0
        loaded = (t >= payload) & (t < unloaded)
        half = int(random.integers(2))
        values[loaded, :, 1 + half] += random.uniform(0.1, 1.0)
        if random.uniform() < 0.5:
            grease = random.uniform(0.1, 0.9) * YEAR
            happened.append(Happened('grease', grease))
            values[t >= grease, :, COULOMB] *= 1.0 - random.uniform(0.1, 0.3)
    season = SEASON * np.sin(2.0 * np.pi * t / YEAR - 1.8)
    temperature = season + WEATHER * random.normal(size=bags)
    values[..., COULOMB] *= (1.0 + DRY * temperature)[:, None]
    values[..., VISCOUS] *= (1.0 + FLOWING * temperature)[:, None]
    kept = tuple(sorted((item for item in happened if t[3] < item.day < t[-4]),
                        key=lambda item: item.day))
    return Year(t, values, kept, joint, rate)
