"""A parameter of a model: one number for all joints or one a joint, with standard deviation."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from par4_kinematics.files import FileModel

Number = float | Annotated[tuple[float, ...], Field(min_length=1)]


class Parameter(FileModel):
    """Value and standard deviation in `unit`, as in `model.yaml`."""

    value: Number
    std: Number | None = None
    unit: str = ''

    @model_validator(mode='after')
    def _std_matches(self) -> Parameter:
        if self.std is not None:
            if isinstance(self.std, tuple) and (
                    not isinstance(self.value, tuple) or len(self.std) != len(self.value)):
                raise ValueError('std must have as many numbers as value')
            if np.min(self.std) < 0:
                raise ValueError(f'std must not be negative, found {self.std}')
        return self

    def per_joint(self, joints: int) -> np.ndarray:
        """Return the value for each of `joints` joints, (joints,)."""
        return np.broadcast_to(np.asarray(self.value, dtype=float), (joints,))
