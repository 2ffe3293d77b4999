#!/usr/bin/env python3
"""How often one exact click in one view suggests the right place in the others.

    teach_figures.py HUETRACKD RECORDING [RECORDING...] [--every 10] [--accept | --radius]

RECORDING: a folder of ../shared/data/rendered or of ../shared/tools/scenes, or configs/demo/recording: with rig.yaml and a truth
that says where in each picture the object is. In every tenth frame of every camera that sees the object it is clicked at, and what
`huetrackd teach --dry-run` suggests in the other cameras is compared with the truth: right within the ball's radius or 8 px, where
cameras are not in step in the nearest picture or one of its neighbours, as it is not said which one was taken.
With --accept each click is saved with what it suggests (`teach --accept`), the whole recording is tracked by it, and the track held
to the truth: how many clicks track the object within 10 mm rms while the state is `tracking`, how many report another one (over 10
cm off then, and over three of the sigmas that are told); where the scene says the range of its paint, the same with that for
comparison. What is predicted while the object is hidden (`coasting`) hangs on how long it is hidden and not on its colour: its error
is in the rms of all samples, which is printed beside it.
With --radius a configuration that says no radius is taught by each click and what it suggests, and the radius that is told is held
to the truth: its error in percent (median, 95 of 100, most), how many are within two of the sigmas that it states, how many are told.
"""
import bisect
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


def configuration(folder, ball, said="radius_m: RADIUS, color: {hue_deg: HUE}"):
    """As somebody writes it who has measured the ball, and whose range of hue is not that of this one."""
    said = said.replace("RADIUS", f"{true_radius_mm(folder) / 1000:g}").replace("HUE", HUES.get(ball, "[0, 40]"))
    return (f"version: 1\nrig: {folder}/rig.yaml\ntargets: {{{ball}: {{{said}}}}}\nobject_tracking: {{volume: {{min: [-1, -1, 0], max: [1, 1, 2.1]}}}}\n"
            "dds: {enabled: false}\n")


def truth_file(folder, ball, work):
    """groundtruth.csv with a column that names the ball, which that of a single one may lack."""
    rows = list(csv.DictReader(open(folder / "groundtruth.csv")))
    file = pathlib.Path(work) / "truth.csv"
    with open(file, "w") as out:
        out.write("ball,t,x,y,z\n")
        for row in rows:
            if row.get("ball", ball) == ball:
                out.write(f"{ball},{row['t']},{row['x']},{row['y']},{row['z']}\n")
    return file


def clicks(cameras, every):
    """(camera, frame, u, v) where the object is seen whole."""
    for clicked, frames in cameras.items():
        for frame in sorted(frames)[::every]:
            u, v, visible, _ = frames[frame]
            if visible > 0.9:
                yield clicked, frame, u, v


FAR_M, SURE_SIGMAS = 0.1, 3  # so far off, and not because it was unsure, it is another object


def while_tracking(tracks, truth, has_late_stamps):
    """(rms in millimetres, how many are of another object) of a track as `replay --tracks` writes it, over the samples in that state;
    None: there is none. Of cameras whose stamps are late, after the one constant shift of time that suits best, as no picture can
    tell it (webcam_figures.py): a ball at 3 m/s is 10 cm from where it was 30 ms before."""
    rows = [[float(row[key]) for key in "txyz"] for row in csv.DictReader(open(truth))]
    times = [row[0] for row in rows]
    found = [row for row in csv.DictReader(open(tracks)) if row["state"] == "tracking"]
    samples = [[float(row[key]) for key in "txyz"] for row in found]
    sigmas = [sum(float(row[key]) for key in ("cxx", "cyy", "czz")) ** 0.5 for row in found]

    def off(shift):
        """Squared, of each sample."""
        for t, *p in samples:
            at = min(max(bisect.bisect(times, t - shift), 1), len(rows) - 1)
            before, after = rows[at - 1], rows[at]
            share = (t - shift - before[0]) / (after[0] - before[0])
            yield sum((a + (b - a) * share - x) ** 2 for a, b, x in zip(before[1:], after[1:], p))

    def typical(shift):
        """The median: one sample of another object does not choose the shift."""
        return sorted(off(shift))[len(samples) // 2]

    if not samples:
        return None
    shift = 0
    if has_late_stamps:
        best = min((k / 1000 for k in range(-80, 81, 2)), key=typical)
        shift = min((best + k / 10000 for k in range(-20, 21)), key=typical)
    return 1000 * (sum(off(shift)) / len(samples)) ** 0.5, sum(o > max(FAR_M, SURE_SIGMAS * s) ** 2 for o, s in zip(off(shift), sigmas))


def by_paint(huetrackd, folder, ball, work):
    """The same with the range that the scene's own pixels give, for comparison: what is not the colour's doing. None: it has none."""
    config, tracks = folder / "huetrackd.yaml", pathlib.Path(work) / "paint.csv"
    if not config.exists() or subprocess.run([huetrackd, "replay", config, folder, "--no-dds", "--tracks", tracks], capture_output=True).returncode:
        return None
    return while_tracking(tracks, truth_file(folder, ball, work), (folder / "frames.csv").exists())


def true_radius_mm(folder):
    """Of a recording's ball; 40 mm where nothing else is said (../shared/data/rendered/README.md)."""
    file = folder / "truth.yaml"
    said = re.search(r"^ball: \{radius_m: ([\d.]+)", file.read_text(), re.M) if file.exists() else None
    return 1000 * float(said[1]) if said else 40.0


def radius_px(folder, camera):
    """Of the recording's ball in the middle of the room: its focal length over its distance from there."""
    text = (folder / "rig.yaml").read_text().split(f"  {camera}:", 1)[1]
    fx = float(re.search(r"fx: ([\d.]+)", text)[1])
    move = [float(x) for x in re.search(r"translation: \[([^\]]*)\]", text)[1].split(",")]
    turn = [[float(x) for x in row.split(",")] for row in re.findall(r"\[([^\[\]]*)\]", re.search(r"rotation: \[(.*)\]", text)[1])]
    middle = (0, 0, 1.1)
    away = sum((sum(r * m for r, m in zip(row, middle)) + t) ** 2 for row, t in zip(turn, move)) ** 0.5
    return fx * true_radius_mm(folder) / 1000 / away


def radii(huetrackd, folders, every):
    everything = []
    print(f"{'recording':>12} {'object':>8}  radius  clicks  told  median error  of 95 %   most  within 2 sigma  mean 2 sigma")

    def row(name, ball, radius, clicked, told):
        if not told:
            print(f"{name:>12} {ball:>8} {radius:7} {clicked:7d}     0")
            return
        off = sorted(abs(e) for e, _ in told)
        print(f"{name:>12} {ball:>8} {radius:>7} {clicked:7d} {len(told):5d} {off[len(off) // 2]:11.1f} % {off[int(0.95 * (len(off) - 1))]:6.1f} % "
              f"{off[-1]:5.1f} % {100 * sum(abs(e) <= s for e, s in told) / len(told):13.0f} % {sum(s for _, s in told) / len(told):11.1f} %", flush=True)

    clicked_in_all = 0
    for folder in folders:
        radius = true_radius_mm(folder)
        for ball, cameras in truth_of(folder).items():
            told, clicked, reasons = [], 0, {}
            with tempfile.TemporaryDirectory() as work:
                config = pathlib.Path(work) / "c.yaml"
                config.write_text(configuration(folder, ball, ""))
                for camera, frame, u, v in clicks(cameras, every):
                    at = f"{camera},{frame},{u:.1f},{v:.1f}"
                    run = subprocess.run([huetrackd, "teach", config, folder, "--at", at, "--accept", "--dry-run"], capture_output=True, text=True)
                    clicked += 1
                    said = re.search(r"a radius of ([\d.]+) mm, give or take ([\d.]+)", run.stdout)
                    if said:
                        rounded = 0.0 if "." in said[1] else 0.5  # mm: as they are said to people
                        told.append((100 * (float(said[1]) / radius - 1), 100 * (float(said[2]) + rounded) / radius))
                        if abs(told[-1][0]) > 8:
                            print(f"    {folder.name} {ball} {at}: {said[0]}")
                    else:
                        why = re.search(r"cannot be measured: ([^.]*)", run.stdout)
                        why = why[1] if why else (run.stdout + run.stderr).strip()[-200:]
                        reasons[why] = reasons.get(why, 0) + 1
            row(folder.name, ball, f"{radius:g} mm", clicked, told)
            for why, n in reasons.items():
                print(f"    {n} not told: {why}")
            everything += told
            clicked_in_all += clicked
    row("all", "", "", clicked_in_all, everything)


def accepted(huetrackd, folders, every):
    good_mm = 10
    total = {}
    print(f"{'recording':>12} {'object':>8}  trials  within {good_mm} mm  worse  another object  no lock  refused")
    for folder in folders:
        for ball, cameras in truth_of(folder).items():
            count = dict.fromkeys(("trials", "good", "worse", "wrong", "none", "refused"), 0)
            with tempfile.TemporaryDirectory() as work:
                if paint := by_paint(huetrackd, folder, ball, work):
                    print(f"    {folder.name} {ball}: by its paint's range {paint[0]:.1f} mm while tracking, {paint[1]} of another object", flush=True)
            for clicked, frame, u, v in clicks(cameras, every):
                with tempfile.TemporaryDirectory() as work:
                    config = pathlib.Path(work) / "c.yaml"
                    config.write_text(configuration(folder, ball))
                    count["trials"] += 1
                    at = f"{clicked},{frame},{u:.1f},{v:.1f}"
                    teach = subprocess.run([huetrackd, "teach", config, folder, "--at", at, "--accept"], capture_output=True, text=True)
                    if teach.returncode != 0:
                        count["refused"] += 1
                        print(f"    {folder.name} {ball} {at}: refused: {teach.stderr.strip()[-300:]}")
                        continue
                    tracks, truth = pathlib.Path(work) / "tracks.csv", truth_file(folder, ball, work)
                    replay = subprocess.run([huetrackd, "replay", config, folder, "--no-dds", "--truth", truth, "--tracks", tracks],
                                            capture_output=True, text=True).stdout
                    all_of_it = re.search(r"rms error ([\d.]+) mm", replay)
                    found = while_tracking(tracks, truth, (folder / "frames.csv").exists()) if all_of_it else None
                    kind = "none" if found is None else "wrong" if found[1] else "good" if found[0] <= good_mm else "worse"
                    count[kind] += 1
                    if kind != "good":
                        print(f"    {folder.name} {ball} {at}: {kind}: " + ("no lock" if found is None else
                              f"{found[0]:.1f} mm while tracking, {found[1]} of another object, with predictions {all_of_it[0]}"), flush=True)
            print(f"{folder.name:>12} {ball:>8} " + " ".join(f"{n:8d}" for n in count.values()), flush=True)
            for key, n in count.items():
                total[key] = total.get(key, 0) + n
    print(f"of {total['trials']} trials {total['good']} within {good_mm} mm ({100 * total['good'] / max(1, total['trials']):.1f} %), {total}")


def main():
    arguments = sys.argv[1:]
    every = 10
    is_accepting = "--accept" in arguments
    if is_accepting:
        arguments.remove("--accept")
    is_of_radius = "--radius" in arguments
    if is_of_radius:
        arguments.remove("--radius")
    if "--every" in arguments:
        at = arguments.index("--every")
        every = int(arguments[at + 1])
        del arguments[at:at + 2]
    huetrackd, folders = arguments[0], [pathlib.Path(name).resolve() for name in arguments[1:]]
    if is_accepting:
        return accepted(huetrackd, folders, every)
    if is_of_radius:
        return radii(huetrackd, folders, every)
    total = [0, 0, 0]
    print(f"{'recording':>12} {'object':>8}  right  wrong  cannot tell")
    for folder in folders:
        for ball, cameras in truth_of(folder).items():
            right = wrong = none = 0
            with tempfile.TemporaryDirectory() as work:
                config = pathlib.Path(work) / "c.yaml"
                config.write_text(configuration(folder, ball))
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
                            by_time = sorted(others.values(), key=lambda row: abs(row[3] - t))
                            nearest, reach = by_time[0], max(8, radius_px(folder, name))
                            is_there = nearest[2] > 0.3
                            in_step = abs(nearest[3] - t) < 0.002
                            if name in said:
                                off = min(((said[name][0] - row[0]) ** 2 + (said[name][1] - row[1]) ** 2) ** 0.5
                                          for row in by_time[:1 if in_step else 2])
                                if nearest[2] > 0 and off <= reach:
                                    right += 1
                                else:
                                    wrong += 1
                                    print(f"    {folder.name} {ball} {clicked},{frame},{u:.0f},{v:.0f}: {name} said {said[name]}, is {nearest[:3]}")
                            elif is_there:
                                none += 1
                                print(f"    {folder.name} {ball} {clicked},{frame},{u:.0f},{v:.0f}: {name} none, is {nearest[:3]}")
            print(f"{folder.name:>12} {ball:>8} {right:6d} {wrong:6d} {none:6d}", flush=True)
            total = [a + b for a, b in zip(total, (right, wrong, none))]
    all_told = max(1, total[0] + total[1])
    print(f"of {sum(total)} views {total[0]} right, {total[1]} wrong, {total[2]} not suggested; of the suggestions {100 * total[0] / all_told:.1f} % right")


main()
