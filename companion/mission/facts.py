"""What the mission may look at: one frozen snapshot a tick, all relative to the pad where the pad is near."""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry import horizontal_norm
from companion.messages import OperatorAction, PadEstimate, Vec3, VehicleStatus
from companion.mission.contact import Contact
from companion.mission.touchdown import TouchdownEvidence


@dataclass(frozen=True, slots=True)
class Facts:
    """`relative_*` is vehicle minus pad in W axes; ages are None where there was never anything.

    `no_fly_zone` holds the vehicle (or the place where it could stop), `no_land_zone` the pad where it will be at contact;
    `tick_gap_s` is the time since the tick before this one, `plan_to_go_s` until the running plan ends (0: flown);
    `sight_age_s` the time since the newest sight of the pad came in (a camera that is always half a second late still sees the
    pad; `pad.vision_age_s` counts from the capture). `pad_is_bent`: it turns or brakes harder than it is to be touched.
    """

    t_ns: int
    status: VehicleStatus | None
    mode_age_s: float | None
    state_age_s: float | None
    distance_from_start_m: float
    height_above_start_m: float
    tilt_rad: float
    pad: PadEstimate | None
    relative_position_m: Vec3 | None
    relative_velocity_m_s: Vec3 | None
    touchdown: TouchdownEvidence
    no_plan_reason: str | None
    operator: OperatorAction | None
    refused: str | None
    frame_age_s: float | None = None
    tick_gap_s: float = 0.0
    distance_from_home_m: float | None = None
    no_fly_zone: str | None = None
    no_land_zone: str | None = None
    unplaced_zones: tuple[str, ...] = ()
    half_deck_m: float = 0.75
    plan_to_go_s: float | None = None
    contact: Contact | None = None
    pad_is_bent: bool = False
    sight_age_s: float | None = None

    @property
    def miss_m(self) -> float | None:
        """Horizontal distance from the pad's landing point."""
        return None if self.relative_position_m is None else horizontal_norm(self.relative_position_m)

    @property
    def relative_speed_m_s(self) -> float | None:
        """Horizontal speed against the pad."""
        return None if self.relative_velocity_m_s is None else horizontal_norm(self.relative_velocity_m_s)

    @property
    def height_above_pad_m(self) -> float | None:
        """Of the vehicle's reference point, positive up."""
        return None if self.relative_position_m is None else -self.relative_position_m[2]
