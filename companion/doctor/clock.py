"""How well is the autopilot's clock known? A frame 10 ms off at 5 m/s is a pad 5 cm off."""

from __future__ import annotations

from companion.doctor.evidence import Evidence, Finding, Level, judged

GOOD_S, POOR_S = 0.003, 0.010
SLOW, WRONG = 0.01, 0.05


def check_clock(evidence: Evidence) -> list[Finding]:
    quality = evidence.clock
    if quality is None or not quality.converged:
        samples = 0 if quality is None else quality.samples
        text = f"the autopilot's clock is not known after {samples} answers to TIMESYNC"
        return [Finding("clock", Level.FAIL, text, "TIMESYNC must pass the link both ways; routers may filter it")]
    return [_offset(evidence), _rate(evidence)]


def _offset(evidence: Evidence) -> Finding:
    assert evidence.clock is not None
    sigma_s, jitter_s = evidence.clock.offset_sigma_s, evidence.offset_jitter_s or 0.0
    trip_s = evidence.clock.shortest_round_trip_s
    text = f"offset known to {1e3 * sigma_s:.1f} ms, jitter {1e3 * jitter_s:.1f} ms"
    text += "" if trip_s is None else f", round trip {1e3 * trip_s:.1f} ms at best"
    worst_s = max(sigma_s, jitter_s)
    remedy = "a shorter or less loaded link; on serial lines a higher baud rate"
    return judged("clock", text, remedy, fails=worst_s > POOR_S, warns=worst_s > GOOD_S)


def _rate(evidence: Evidence) -> Finding:
    assert evidence.clock is not None
    off = abs(evidence.clock.rate)
    text = f"its second is {100 * off:.2f} % off ours"
    remedy = "a simulator below real time? Close other programs, or lower its speed"
    return judged("clock", text, remedy, fails=off > WRONG, warns=off > SLOW)
