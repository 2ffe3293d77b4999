#!/usr/bin/env python3
"""How often one exact click in one view suggests the right place in the others.

    teach_figures.py HUETRACKD RECORDING [RECORDING...] [--every 10]

RECORDING: a folder of ../shared/data/rendered or of ../shared/tools/scenes, or configs/demo/recording: with rig.yaml and a truth
that says where in each picture the object is. In every tenth frame of every camera that sees the object it is clicked at, and what
`huetrackd teach --dry-run` suggests in the other cameras is compared with the truth: right within the ball's radius or 5 px.
"""
import csv
import pathlib
import re
import subprocess
import sys
import tempfile

HUES = {"lime": "[65, 115]", "pink": "[310, 355]"}


def truth_of(folder):
    """{ball: {camera: {frame: (u, v, visible share, time)}}}"""
    out = {}
    if (folder / "frames.csv").exists():
        for row in csv.DictReader(open(folder / "frames.csv")):
            if row.get("u") and float(row.get("visible") or 0) >= 0:
                ball = row.get("ball", "ball")
                out.setdefault(ball, {}).setdefault(row["camera"], {})[int(row["frame"])] = (
                    float(row["u"]), float(row["v"]), float(row["visible"]), float(row["stamp_s"]))
        return out
    for row in csv.DictReader(open(folder / "groundtruth.csv")):
        for key in row:
            if key.startswith("u_"):
                camera = key[2:]
                out.setdefault(row["ball"], {}).setdefault(camera, {})[int(row["frame"])] = (
                    float(row[key] or "nan"), float(row["v_" + camera] or "nan"), float(row["vis_" + camera] or 0), float(row["t"]))
    return out


def main():
    arguments = sys.argv[1:]
    every = 10
    if "--every" in arguments:
        at = arguments.index("--every")
        every = int(arguments[at + 1])
        del arguments[at:at + 2]
    huetrackd, folders = arguments[0], [pathlib.Path(name).resolve() for name in arguments[1:]]
    total = [0, 0, 0]
    print(f"{'recording':>12} {'object':>8}  right  wrong  cannot tell")
    for folder in folders:
        for ball, cameras in truth_of(folder).items():
            right = wrong = none = 0
            with tempfile.TemporaryDirectory() as work:
                config = pathlib.Path(work) / "c.yaml"
                config.write_text(f"version: 1\nrig: {folder}/rig.yaml\ntargets: {{{ball}: {{radius_m: 0.04, color: {{hue_deg: "
                                  f"{HUES.get(ball, '[0, 40]')}}}}}}}\nobject_tracking: {{volume: {{min: [-1, -1, 0], max: [1, 1, 2.1]}}}}\n"
                                  "dds: {enabled: false}\n")
                for clicked, frames in cameras.items():
                    for frame in sorted(frames)[::every]:
                        u, v, visible, t = frames[frame]
                        if not visible > 0.9:
                            continue
                        run = subprocess.run([huetrackd, "teach", config, folder, "--at", f"{clicked},{frame},{u:.1f},{v:.1f}", "--dry-run"],
                                             capture_output=True, text=True)
                        said = dict()
                        for name, su, sv in re.findall(r"camera (\S+): the object is probably at (-?\d+), (-?\d+)", run.stdout):
                            said[name] = (float(su), float(sv))
                        for name, others in cameras.items():
                            if name == clicked:
                                continue
                            nearest = min(others.values(), key=lambda row: abs(row[3] - t))
                            is_there = nearest[2] > 0.3
                            if name in said:
                                off = ((said[name][0] - nearest[0]) ** 2 + (said[name][1] - nearest[1]) ** 2) ** 0.5
                                if nearest[2] > 0 and off <= 8:
                                    right += 1
                                else:
                                    wrong += 1
                                    print(f"    {folder.name} {ball} {clicked},{frame},{u:.0f},{v:.0f}: {name} said {said[name]}, is {nearest[:3]}")
                            elif is_there:
                                none += 1
            print(f"{folder.name:>12} {ball:>8} {right:6d} {wrong:6d} {none:6d}", flush=True)
            total = [a + b for a, b in zip(total, (right, wrong, none))]
    all_told = max(1, total[0] + total[1])
    print(f"of {sum(total)} views {total[0]} right, {total[1]} wrong, {total[2]} not suggested; of the suggestions {100 * total[0] / all_told:.1f} % right")


main()
