"""What goes wrong in a lidar's measurement: each effect has its own setting, off by default, and its own stream."""

from dataclasses import dataclass, fields
from types import MappingProxyType

_UPPER_BOUNDS = MappingProxyType({"range_sigma_m": 10.0, "angle_sigma_rad": 0.1})


@dataclass(frozen=True)
class NoiseConfig:
    """The effects of a lidar; none touches a beam that has no return.

    Raises:
        ValueError: a value is out of its range.
    """

    range_sigma_m: float = 0.0
    """Standard deviation of the Gaussian noise of a range, metres, 0 to 10."""
    range_sigma_ratio: float = 0.0
    """Standard deviation of the noise that grows with the range, as a share of it, 0 to 1."""
    angle_sigma_rad: float = 0.0
    """Standard deviation of the direction in which a beam really goes, radians, 0 to 0.1."""
    dropout: float = 0.0
    """Probability that a return is invalid (NaN)."""
    max_range_miss: float = 0.0
    """A return from range r is too weak, and reads "no return", with this probability times (r / range_max)^2."""
    mixed_pixel: float = 0.0
    """Probability that a beam beside an edge (its neighbour's range differs by more than 0.3 m) hits both surfaces
    and reads a range between them."""
    glass: float = 0.0
    """Probability that a beam passes through glass; within 8 degrees of the normal glass returns it always."""
    incidence_loss: float = 0.0
    """A return under incidence angle a is lost with this probability times (1 - cos a)^4."""
    skew: bool = False
    """Whether the beams of a scan leave one after the other from a moving robot, ``time_increment_s`` apart (else
    all at the scan's stamp)."""

    def __post_init__(self) -> None:
        """Refuse what is no noise."""
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "skew" and not 0.0 <= value <= _UPPER_BOUNDS.get(field.name, 1.0):
                allowed = f"in [0, {_UPPER_BOUNDS.get(field.name, 1.0):g}]"
                raise ValueError(f"noise: {field.name} must be {allowed}, got {value:g}")


NOISE_PRESETS = MappingProxyType(
    {
        "none": NoiseConfig(),
        "low": NoiseConfig(
            range_sigma_m=0.005,
            range_sigma_ratio=0.0005,
            angle_sigma_rad=0.0005,
            dropout=0.001,
            max_range_miss=0.01,
            mixed_pixel=0.05,
            glass=0.5,
            incidence_loss=0.1,
            skew=True,
        ),
        "realistic": NoiseConfig(
            range_sigma_m=0.01,
            range_sigma_ratio=0.001,
            angle_sigma_rad=0.0015,
            dropout=0.003,
            max_range_miss=0.05,
            mixed_pixel=0.2,
            glass=0.8,
            incidence_loss=0.3,
            skew=True,
        ),
        "high": NoiseConfig(
            range_sigma_m=0.03,
            range_sigma_ratio=0.005,
            angle_sigma_rad=0.005,
            dropout=0.02,
            max_range_miss=0.3,
            mixed_pixel=0.5,
            glass=0.95,
            incidence_loss=0.8,
            skew=True,
        ),
    }
)
"""Noise levels by name; ``realistic`` is that of a good indoor scanner (SICK LMS 200: 5 mm, Hokuyo UTM-30LX: 10 mm
one sigma within 10 m; beam divergence 0.25 to 0.5 degrees beside a step of 1 degree)."""
