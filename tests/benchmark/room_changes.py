#!/usr/bin/env python3
"""What happens to a camera's lens and to its room while it is watched, made with good recordings: is it told, and by its name?

    room_changes.py HUETRACKD [--seeds N] [--only WORD] [--verbose] SCENE...

SCENE: a folder of ../shared/tools/scenes, or of ../shared/data/rendered with colour videos. From a moment on that the seed draws one
camera's pictures are changed (blurred, zoomed about the principal point, a textured box set into them, veiled, smeared, made noisy,
compressed), about which nothing may be said before; what is changed is written as JPEG of quality 90 but where it says otherwise.
Printed per change: how often it is told right, how often anything else is told, and after how many seconds.
Needs Debian's ffmpeg, python3-numpy, python3-yaml and python3-opencv."""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

import cv2
import numpy as np
import yaml

TOLD = re.compile(r"^  cameras reported at ([\d.]+) s: (.*)$", re.M)


class Change:
    """pattern: of the sentence that is right; none: nothing may be said of it. size: what the sentence's first group is to be."""

    def __init__(self, name, picture, pattern=None, size=None, within_s=2.0, quality=90, takes_s=0.0):
        self.name, self.picture, self.pattern, self.size = name, picture, pattern, size
        self.within_s, self.quality, self.takes_s = within_s, quality, takes_s


def blurred(sigma):
    return lambda image, share, world, t: cv2.GaussianBlur(image, (0, 0), sigma * share) if share * sigma > 0.1 else image


def zoomed(by):
    def make(image, share, world, t):
        s, (cx, cy) = 1 + by * share, world["axis"]
        return cv2.warpAffine(image, np.array([[s, 0, cx - s * cx], [0, s, cy - s * cy]]), image.shape[1::-1],
                              flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return make


def texture(rng, height, width):
    """Coarse and fine spots of two colours, as of a printed box."""
    spots = sum(cv2.resize(rng.random((max(2, height // k), max(2, width // k))), (width, height), interpolation=cv2.INTER_CUBIC)
                for k in (24, 9)) / 2
    colours = np.array([rng.integers(10, 80, 3), rng.integers(150, 240, 3)])
    return np.clip(colours[0] + spots[..., None] * (colours[1] - colours[0]), 0, 255).astype(np.uint8)


def thing(area, speed=0.0, sway_px=0.0, is_plain=False):
    """A box that covers so much of the picture; or somebody who walks by with so many widths in a second, or stands and sways."""
    def make(image, share, world, t):
        height, width = image.shape[:2]
        if "thing" not in world:
            rng = world["rng"]
            h = int(height * np.sqrt(area) * rng.uniform(0.8, 1.25))
            w = int(area * height * width / h)
            world["thing"] = np.full((h, w, 3), rng.integers(60, 200, 3), np.uint8) if is_plain else texture(rng, h, w)
            world["corner"] = rng.integers(0, height - h), rng.integers(0, width - w)
        (v, u), box = world["corner"], world["thing"]
        h, w = box.shape[:2]
        if speed:
            u = int(-w + t * speed * width)
        shift = sway_px * np.sin(2 * np.pi * 0.4 * t), 0.5 * sway_px * np.sin(2 * np.pi * 0.27 * t + 1)
        warp = np.array([[1, 0, u + shift[0]], [0, 1, v + shift[1]]])
        mask = cv2.warpAffine(np.ones((h, w), np.float32), warp, (width, height))[..., None]
        set_in = cv2.warpAffine(box, warp, (width, height), flags=cv2.INTER_LINEAR).astype(np.float32)
        grain = world["grain"].normal(0, 2, image.shape)
        return np.clip(image * (1 - mask) + (set_in + grain) * mask, 0, 255).astype(np.uint8)
    return make


def dirty(area, contrast, blur):
    """A soft-edged place of the lens through which little is seen."""
    def make(image, share, world, t):
        height, width = image.shape[:2]
        if area < 1 and "place" not in world:
            rng, r = world["rng"], np.sqrt(area * height * width / np.pi)
            v, u = np.mgrid[:height, :width]
            far = np.hypot(u - rng.uniform(0.25, 0.75) * width, v - rng.uniform(0.25, 0.75) * height) / r
            world["place"] = np.clip((1.25 - far) / 0.5, 0, 1)[..., None]
        place = world["place"] if area < 1 else 1.0
        soft = cv2.GaussianBlur(image, (0, 0), blur).astype(np.float32) if blur else image.astype(np.float32)
        return np.clip(image * (1 - place) + (170 + contrast * (soft - 170)) * place, 0, 255).astype(np.uint8)
    return make


def light(gain, gamma=1.0):
    return lambda image, share, world, t: np.clip(255 * (image / 255.0) ** gamma * gain, 0, 255).astype(np.uint8)


def noisy(sigma):
    return lambda image, share, world, t: np.clip(image + world["grain"].normal(0, sigma, image.shape), 0, 255).astype(np.uint8)


def both(first, second):
    return lambda image, share, world, t: second(first(image, share, world, t), share, world, t)


def as_it_is(image, share, world, t):
    return image


FOCUS, ROOM = r"{}'s focus has changed.*blurred by ([\d.]+) px", r"room has changed in {}'s view \(about ([\d.]+) %"
ZOOM, DIRT = r"{}'s picture (?:grew|shrank) by ([\d.]+) %", r"{} has seen next to nothing"
CHANGES = [
    Change("none", as_it_is),
    *[Change(f"blur_{s}", blurred(s), FOCUS, s, takes_s=t) for s, t in ((1, 0), (1.5, 1), (2, 1), (3, 0), (4, 1), (6, 1))],
    Change("blur_2_noisy", both(blurred(2), noisy(4)), FOCUS, 2, takes_s=1),
    Change("blur_2_dark", both(blurred(2), light(0.5)), FOCUS, 2, takes_s=1),
    Change("blur_2_jpeg40", blurred(2), FOCUS, 2, quality=40),
    # A quarter of the patches is looked at in two seconds; who stands there is waited for.
    *[Change(f"box_{a}", thing(a), ROOM, 100 * a, within_s=10) for a in (0.08, 0.15, 0.3)],
    Change("plain_box_0.15", thing(0.15, is_plain=True), r"(?:part of {0}'s picture|changed in {0}'s view) \(about ([\d.]+) %", 15,
           within_s=12),
    *[Change(f"zoom_{z}", zoomed(z), ZOOM, 100 * abs(z)) for z in (0.01, 0.02, 0.03, 0.05, -0.01, -0.02, -0.03, -0.05)],
    Change("veil_all", dirty(1, 0.15, 0), DIRT),
    Change("smear_all", dirty(1, 0.15, 8), DIRT),
    Change("dirt_0.2", dirty(0.2, 0.1, 8), r"a part of {}'s picture \(about ([\d.]+) %", 20, within_s=12),
    Change("black", light(0.02), DIRT),
    # Nothing is to be told of these.
    Change("walks_by", thing(0.15, speed=0.15)), Change("walks_fast", thing(0.2, speed=0.5)),
    Change("stands", thing(0.12, sway_px=2.5)), Change("half_light", light(0.5)), Change("gamma", light(1, 1.4)),
    Change("veil_half", dirty(1, 0.5, 0)), Change("noise_4", noisy(4)), Change("jpeg_25", as_it_is, quality=25),
]


def changed(scene, change, seed, scratch):
    """The camera, and when it was changed. The recording with it is in `scratch`."""
    rng = np.random.default_rng([seed, sum(map(ord, change.name))])
    recording = yaml.safe_load((scene / "recording.yaml").read_text())
    rig = yaml.safe_load((scene / "rig.yaml").read_text())
    for camera in recording["cameras"].values():
        for key in ("frames", "timestamps"):
            if key in camera:
                camera[key] = str(scene / camera[key])
    name = list(recording["cameras"])[int(rng.integers(len(recording["cameras"])))]
    video = cv2.VideoCapture(recording["cameras"][name]["frames"])
    fps = recording["cameras"][name].get("fps") or video.get(cv2.CAP_PROP_FPS) or 30
    from_s = float(rng.uniform(2.2, 3.2))
    k = rig["cameras"][name]["intrinsics"]
    world = {"rng": rng, "grain": np.random.default_rng(seed), "axis": (k["cx"], k["cy"])}
    pictures = pathlib.Path(scratch, "pictures")
    pictures.mkdir()
    count = 0
    while True:
        ok, image = video.read()
        if not ok:
            break
        t = count / fps - from_s
        quality = 90
        if t >= 0:
            share = 1.0 if change.takes_s == 0 else min(1.0, t / change.takes_s)
            image, quality = change.picture(image, share, world, t), change.quality
        cv2.imwrite(str(pictures / f"{count:05}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, quality])
        count += 1
    out = f"{scratch}/changed.mkv"
    subprocess.run(["ffmpeg", "-v", "error", "-framerate", f"{fps}", "-i", str(pictures / "%05d.jpg"), "-c:v", "copy", out], check=True)
    recording["cameras"][name]["frames"] = out
    config = yaml.safe_load((scene / "huetrackd.yaml").read_text()) if (scene / "huetrackd.yaml").exists() else {
        "version": 1, "object_tracking": {"volume": {"min": [-1, -1, 0.1], "max": [1, 1, 2.1]}}, "dds": {"enabled": False},
        "targets": {"ball": {"radius_m": 0.04, "color": {"hue_deg": [310, 355]}}}}
    config["rig"] = str(scene / "rig.yaml")
    config.pop("cameras", None)
    for file, content in (("recording", recording), ("huetrackd", config)):
        pathlib.Path(scratch, file + ".yaml").write_text(yaml.safe_dump(content))
    return name, from_s + change.takes_s


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("huetrackd")
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--verbose", action="store_true")
    a = parser.parse_args()
    print("change           runs  told right  in time  others  after [s]: mean, most   size (should be): least to most")
    for change in CHANGES:
        if not re.search(a.only, change.name):
            continue
        runs = right = in_time = others = 0
        after, sizes = [], []
        for scene in a.scenes:
            for seed in range(a.seeds):
                with tempfile.TemporaryDirectory() as scratch:
                    camera, at = changed(scene.resolve(), change, seed, scratch)
                    done = subprocess.run([a.huetrackd, "replay", f"{scratch}/huetrackd.yaml", scratch, "--no-dds"],
                                          capture_output=True, text=True, check=True)
                told = TOLD.findall(done.stdout)
                found = [(float(t) - at, re.search(change.pattern.format(camera), text)) for t, text in told] if change.pattern else []
                found = [(t, match) for t, match in found if match]
                wrong = [text for t, text in told if not change.pattern or not re.search(change.pattern.format(camera), text)]
                runs, right, others = runs + 1, right + bool(found), others + bool(wrong)
                if found:
                    after.append(found[0][0])
                    in_time += found[0][0] <= change.within_s
                    if found[0][1].groups():
                        sizes.append(float(found[0][1][1]))
                if a.verbose and (wrong or bool(found) != bool(change.pattern)):
                    print(f"  {scene.name} {seed}: {camera} at {at:.2f} s: {told}")
        times = f"{np.mean(after):5.2f} {max(after):5.2f}" if after else "    -     -"
        size = f"({change.size:g}): {min(sizes):g} to {max(sizes):g}" if sizes else ""
        print(f"{change.name:16} {runs:4} {right if change.pattern else '-':>11} {in_time if change.pattern else '-':>8} {others:7}  {times:>22}   {size}", flush=True)


if __name__ == "__main__":
    main()
