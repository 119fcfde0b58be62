"""Array types of the camera package."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
"""(height, width) grey or (height, width, 3) BGR."""

Floats = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]

Vec3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Hamilton, w x y z, unit."""
