"""Positions from huetrack, with nothing but Python's standard library (3.9 or later).

    import huetrack
    for p in huetrack.positions():
        print(p.target, p.t, p.position, p.sigma)

Needs `huetrack view` on this host or on another one: huetrack.positions("http://pi-3:8765", token="..."). The stream is
JSON over HTTP (server-sent events), see README.md in this folder.

As a program: python3 huetrack.py [ADDRESS] prints a line for each position.
"""

import json
import math
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass, field

__all__ = ["Position", "CameraPose", "HuetrackError", "positions", "camera_poses"]

DEFAULT_ADDRESS = "http://127.0.0.1:8765"
# The bridge sends a pulse every second; without one for this time the connection is dead.
_SILENCE_S = 5.0


class HuetrackError(Exception):
    """The bridge refuses the request, cannot be reached, or has another version."""


@dataclass(frozen=True)
class Position:
    """A target's estimate. position, velocity and covariance are None while it is searching or lost."""

    target: str
    t: float  # capture time that the position refers to, UNIX seconds
    state: str  # "searching", "tracking", "coasting" (predicted), "lost"
    position: tuple  # x, y, z in the rig's world frame, metres
    velocity: tuple  # m/s
    covariance: tuple  # of the position, 9 numbers, row by row, m^2
    confidence: float  # probability that it is the object, 0..1
    views: int  # cameras that see it
    raw: dict = field(repr=False, compare=False)  # the whole event

    @property
    def sigma(self):
        """Standard deviation along x, y and z, metres; None without a position."""
        return self.covariance and tuple(math.sqrt(max(0.0, self.covariance[i])) for i in (0, 4, 8))


@dataclass(frozen=True)
class CameraPose:
    """A tracked camera's pose: p_world = R(orientation) p_camera + position. None without a pose."""

    camera: str
    t: float
    state: str
    position: tuple
    orientation: tuple  # quaternion x, y, z, w
    sigma: tuple  # of the position, metres
    raw: dict = field(repr=False, compare=False)


def positions(address=DEFAULT_ADDRESS, target=None, token=None, reconnect=True):
    """Every position from now on, one per frame set and target. Waits for the bridge and reconnects after its restarts;
    with reconnect=False it ends, or raises HuetrackError, instead."""
    for raw in _events(address, "/api/v1/positions", "position", token, reconnect):
        if target is not None and raw["target"] != target:
            continue
        yield Position(raw["target"], raw["t"], raw["state"], _numbers(raw["position"]), _numbers(raw["velocity"]),
                       _numbers(raw["covariance"]), raw["confidence"], raw["views"], raw)


def camera_poses(address=DEFAULT_ADDRESS, camera=None, token=None, reconnect=True):
    """The same for tracked cameras (camera_tracking:)."""
    for raw in _events(address, "/api/v1/camera_poses", "camera_pose", token, reconnect):
        if camera is not None and raw["camera"] != camera:
            continue
        yield CameraPose(raw["camera"], raw["t"], raw["state"], _numbers(raw["position"]),
                         _numbers(raw["orientation"]), _numbers(raw["sigma"]), raw)


def _numbers(values):
    return None if any(v is None for v in values) else tuple(values)


def _events(address, path, name, token, reconnect):
    url = address.rstrip("/") + path + ("?" + urllib.parse.urlencode({"token": token}) if token else "")
    while True:
        try:
            with urllib.request.urlopen(url, timeout=_SILENCE_S) as stream:
                yield from _parsed(stream, name)
        except urllib.error.HTTPError as error:  # a retry would fail, too
            why = error.read(1000).decode("utf-8", "replace").strip()
            if error.code == 503 and reconnect:
                time.sleep(1)
                continue
            raise HuetrackError(f"{address}: {why or error}") from None
        except (OSError, urllib.error.URLError) as error:
            if not reconnect:
                raise HuetrackError(f"{address}: {error}; does `huetrack view` run there?") from None
        if not reconnect:
            return
        time.sleep(0.5)


def _parsed(stream, name):
    """Server-sent events: lines `event: NAME`, `data: JSON`, then an empty one."""
    event = None
    for line in stream:
        line = line.rstrip(b"\r\n")
        if line.startswith(b"event: "):
            event = line[7:].decode("ascii", "replace")
        elif line.startswith(b"data: ") and event == name:
            yield json.loads(line[6:])


def _main():
    try:
        for p in positions(*sys.argv[1:2]):
            where = "  ".join(f"{c:8.4f}" for c in p.position) if p.position else "-"
            sigma = f"  +- {1e3 * max(p.sigma):.1f} mm" if p.sigma else ""
            print(f"{p.t:.4f}  {p.target}  {p.state:<9}  {where}{sigma}", flush=True)
    except HuetrackError as error:
        sys.exit(f"huetrack: {error}")
    except (KeyboardInterrupt, BrokenPipeError):
        pass


if __name__ == "__main__":
    _main()
