#!/usr/bin/python3
"""Scale and vertical of `huetrack-calibrate wave` from five throws, beside what it states.

    throws.py scene --seed N --out DIR [--seconds 18] [--density 350]   # scenes.py webcams_wave, then five throws that bounce
    throws.py figures DIR... [-- OPTIONS OF wave]                       # neither tape nor poses: scale and up from the throws alone

The throws have a sphere's drag (coefficient 0.47), and the air carries the ball; --density: kg/m^3, 0: no air. Truth: the scene's rig.yaml.
figures also takes other scenes with throws. --build DIR of the programs, default build/release. Exit status 1: a figure of
issue "Ball alone" is missed (scale within 0.7 %, vertical within 0.5 degrees), or more are outside of their own 95 % than by chance.
"""
import math
import os
import pathlib
import re
import sys
import tempfile

import numpy as np

MAIN = pathlib.Path(__file__).resolve().parents[2]
SCENES = MAIN.parent / "shared/tools/scenes"
GRAVITY, AIR, DRAG = 9.81, 1.2, 0.47
FLOOR_M, STEP_S = 0.15, 1e-4
MOST_SCALE, MOST_DEG = 0.007, 0.5


def quintic(p0, v0, p1, v1, seconds):
    """positions and velocities at STEP_S, without acceleration at either end"""
    u = np.arange(0, 1, STEP_S / seconds)[:, None]
    a, b = v0 * seconds, v1 * seconds
    c3, c4, c5 = 10 * (p1 - p0) - 6 * a - 4 * b, -15 * (p1 - p0) + 8 * a + 7 * b, 6 * (p1 - p0) - 3 * a - 3 * b
    return (p0 + a * u + c3 * u**3 + c4 * u**4 + c5 * u**5,
            (a + 3 * c3 * u**2 + 4 * c4 * u**3 + 5 * c5 * u**4) / seconds)


def flight(p, v, radius, density, bounced, until):
    """with drag, buoyancy and added mass; one bounce of FLOOR_M; ends where it comes down to `until` after that"""
    air = AIR / density if density else 0
    drag = 3 / 8 * air * DRAG / radius / (1 + air / 2)
    down = np.array([0, 0, -GRAVITY * (1 - air) / (1 + air / 2)])
    places, speeds, bounces = [], [], 0
    while not (bounces == bounced and v[2] < 0 and p[2] < until):
        places.append(p), speeds.append(v)
        middle = v + STEP_S / 2 * (down - drag * np.linalg.norm(v) * v)
        p, v = p + STEP_S * middle, v + STEP_S * (down - drag * np.linalg.norm(middle) * middle)
        if p[2] < FLOOR_M + radius and v[2] < 0:
            bounces, v = bounces + 1, v * [0.9, 0.9, -0.8]
        if bounces > bounced or len(places) * STEP_S > 2:
            return None
    return np.array(places), np.array(speeds), p, v


def throws(rng, place, radius, density):
    """five: carried to the hand's place, thrown, bounced (the last two not), caught"""
    parts, here, still = [], place, np.zeros(3)
    while len(parts) < 5 * 3:
        start = np.array([*rng.uniform(-0.45, 0.45, 2), rng.uniform(0.8, 1.1)])
        aim = rng.uniform(-0.3, 0.3, 2)
        bounced = len(parts) < 9
        v = np.array([*((aim - start[:2]) / 0.75), rng.uniform(1.2, 2.4) if bounced else rng.uniform(2.4, 3.6)])
        flown = flight(start, v, radius, density, int(bounced), rng.uniform(0.45, 0.6) if bounced else 0.9)
        if flown is None or np.abs(flown[0][:, :2]).max() > 0.75 or flown[0][:, 2].max() > 1.9:
            continue
        carried = quintic(here, still, start, v, rng.uniform(0.5, 0.8))
        here = flown[2] + [0, 0, -0.1]
        parts += [carried, flown[:2], quintic(flown[2], flown[3], here, still, 0.25)]
    return parts


def waved_and_thrown(motions, density):
    """in place of motions.draw_ball"""
    draw = motions.draw_ball

    def ball(rng, seconds, vmax, radius=0.04, **options):
        waved = draw(rng, seconds, vmax, radius=radius, **options)
        parts = throws(rng, np.array([0, 0, 1.0]), radius, density)
        begin = seconds - STEP_S * sum(len(p) for p, _ in parts)
        if begin < 5:
            raise SystemExit("--seconds: too short for five throws")
        times = np.arange(-0.2, begin - 0.5, STEP_S)
        last = waved(times[-1])
        joined = quintic(last, waved.vel(times[-1]), np.array([0, 0, 1.0]), np.zeros(3), 0.5)
        parts = [(waved(times), waved.vel(times)), joined, *parts]
        end = parts[-1][0][-1]
        parts.append((np.tile(end, (5000, 1)), np.zeros((5000, 3))))
        return motions.Table(-0.2, STEP_S, np.concatenate([p for p, _ in parts]), np.concatenate([v for _, v in parts]))

    motions.draw_ball = ball


def make_scene(arguments):
    sys.path.insert(0, str(SCENES))
    import motions
    import scenes

    density = 350.0
    if "--density" in arguments:
        at = arguments.index("--density")
        density = float(arguments[at + 1])
        del arguments[at:at + 2]
    waved_and_thrown(motions, density)
    if "--seconds" not in arguments:
        arguments += ["--seconds", "18"]
    sys.argv = ["scenes.py", "webcams_wave", *arguments]
    scenes.main()


def poses(file):
    import yaml

    sys.path.insert(0, str(MAIN / "tests/oracle"))
    import figures as oracle

    found = [oracle.pose_of(c) for c in yaml.safe_load(pathlib.Path(file).read_text())["cameras"].values()]
    return [r for r, _ in found], np.array([-r.T @ t for r, t in found])


def errors(found, truth):
    """of the scale, and of z in degrees"""
    (turned, centres), (true_turned, true_centres) = poses(found), poses(truth)
    off, true_off = centres - centres.mean(0), true_centres - true_centres.mean(0)
    # the found world in the true one, by the cameras' axes
    u, _, vt = np.linalg.svd(sum(t.T @ f for f, t in zip(turned, true_turned)))
    world = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    up = world[:, 2]
    return np.linalg.norm(off) / np.linalg.norm(true_off) - 1, np.degrees(np.arccos(np.clip(up[2], -1, 1)))


def measure(build, scene, options):
    import subprocess

    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder, "rig.yaml")
        asked = [build / "calib/program/huetrack-calibrate", "wave", scene, "--config", scene / "huetrackd.yaml", "--target", "ball", "--no-poses", "--rig", out, *options]
        run = subprocess.run([str(a) for a in asked], capture_output=True, text=True)
        if not out.exists():
            return run.stdout + run.stderr
        text = run.stdout
        scale, tilt = errors(out, scene / "rig.yaml")
        stated = re.search(r"accurate to ([0-9.]+) %", text)
        vertical = re.search(r"\+- ([0-9.]+) degrees, by (\d+) free flights", text)
        expected = re.search(r"in the whole volume: ([0-9.]+) mm rms, and by the scale ([0-9.]+)", text)
    if not vertical:
        return "no free flight was found\n" + text
    return (scale, float(stated[1]) / 100, tilt, float(vertical[1]), int(vertical[2]),
            float(np.hypot(*map(float, expected.groups()))) if expected else float("nan"))


def figures(arguments):
    build = MAIN / "build/release"
    if "--build" in arguments:
        at = arguments.index("--build")
        build = pathlib.Path(arguments[at + 1])
        del arguments[at:at + 2]
    at = arguments.index("--") if "--" in arguments else len(arguments)
    print("scene            flights   scale off   stated 95 %   vertical off   stated 95 %   expected, mm")
    missed, outside, count = 0, 0, 0
    for name in arguments[:at]:
        figure = measure(build, pathlib.Path(name), arguments[at + 1:])
        if isinstance(figure, str):
            print(f"{name:16} FAILED: {figure[-600:]}")
            missed += 1
            continue
        scale, scale_sigma, tilt, tilt_rms, flights, expected = figure
        # 95 %: 1.96 sigma of one number; of two that are equally sure 1.73 times their common rms
        within = 1.96 * scale_sigma, 1.73 * tilt_rms
        off = (abs(scale) > within[0]) + (tilt > within[1])
        too_far = abs(scale) > MOST_SCALE or tilt > MOST_DEG
        missed, outside, count = missed + too_far, outside + off, count + 2
        print(f"{os.path.basename(name):16} {flights:7}   {100 * scale:+8.2f} %   {100 * within[0]:9.2f} %   {tilt:8.2f} deg"
              f"   {within[1]:7.2f} deg   {expected:9.1f}{'   outside' if off else ''}{'   MISSED' if too_far else ''}", flush=True)
    allowed = next(k for k in range(count + 1) if sum(math.comb(count, i) * 0.05**i * 0.95**(count - i) for i in range(k + 1)) >= 0.99)
    print(f"{missed} missed; {outside} of {count} outside of their 95 %, chance allows {allowed}")
    return 1 if missed or outside > allowed else 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["scene"]:
        make_scene(sys.argv[2:])
    elif sys.argv[1:2] == ["figures"]:
        sys.exit(figures(sys.argv[2:]))
    else:
        sys.exit(__doc__)
