#!/usr/bin/python3
"""A ball that a person carries, throws and lays down, in a room with wood, skin and clothes of its colour: figures per seed.

    hands.py [--seeds 81,82] [--build DIR]... [-- OPTIONS OF scenes.py hand]     # default: --ball orange --seconds 8

Scenes are made once (some two minutes each) and kept (tests/oracle/oracle.py, made()). With several --build, each beside the others. Counted are
the sets in which two views see a fifth of the ball or more; rms and NEES with the constant that free-running stamps are late by taken out.
"""
import argparse
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "oracle")]
import figures
import oracle

LEAST_VISIBLE = 0.2


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    options = words[split + 1:] or ["--ball", "orange", "--seconds", "8"]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="81,82,83,91,93")
    parser.add_argument("--build", type=pathlib.Path, action="append")
    arguments = parser.parse_args(words[:split])
    print("seed  build                tracking_pct   over_10cm      rms_mm        nees  inside95_pct")
    for seed in arguments.seeds.split(","):
        scene = oracle.made("hand", int(seed), *options)
        for build in arguments.build or [ROOT / "build" / "release"]:
            config = oracle.config_of(scene)
            tracks, _ = oracle.replay(oracle.Programs(build), config, scene)
            free_shift = (scene / "cam0.csv").exists()  # cameras that run freely
            out = figures.track_figures(tracks, scene, {name: name for name in config["targets"]}, LEAST_VISIBLE, free_shift)
            row = [out.get(name, float("nan")) for name in ("tracking_pct", "far", "rms_mm", "nees", "inside95_pct")]
            print(f"{seed:5s} {str(build)[-18:]:18s} " + " ".join(f"{value:12.3g}" for value in row), flush=True)


if __name__ == "__main__":
    main()
