#!/usr/bin/python3
"""How well several objects of one colour are tracked, beside OpenCV blobs, triangulated points and a Hungarian assignment.

    tests/benchmark/many_figures.py build/release/service/daemon/huetrackd SCENE... [--no-opencv] [--count "up to 8"] [--verbose]

SCENE: folders of ../shared/data/rendered (juggling, swarm_public) and of ../shared/tools/scenes (`scenes.py juggling|swarm --seed N`).
count is 3 where truth.yaml says kind juggling, else "up to" 16, if not given.

Compared are, per frame set, the balls in the volume that two or more views see (more than half of each) with what is `tracking`, at a
gate of 10 cm. A ball that fewer see, or on the border of the volume, counts neither way. MOTA, identity switches: Bernardin and
Stiefelhagen 2008; IDF1: Ristani et al. 2016. ghost: the longest run of sets in which something is `tracking` that is near no ball
at all; births: sets from being visible in two views to `tracking`, 0 in the same set; ends: seconds from leaving to the end.
Needs Debian's python3-numpy, python3-scipy, python3-yaml and python3-opencv.
"""
import argparse
import csv
import math
import os
import subprocess
import tempfile
from collections import defaultdict

import numpy as np
import yaml
from scipy.optimize import linear_sum_assignment

GATE_M = 0.10


def matched(distance, gate):
    """Pairs (row, column) within the gate, as many as possible and as near as possible."""
    n, m = distance.shape
    if n == 0 or m == 0:
        return []
    cost = np.where(distance <= gate, distance, 1e3)
    cost = np.hstack([cost, np.full((n, n), 1e2)])
    return [(i, j) for i, j in zip(*linear_sum_assignment(cost)) if j < m and distance[i, j] <= gate]


class Truth:
    def __init__(self, folder):
        self.rows = defaultdict(dict)  # frame -> ball -> (position, counts, is_inside)
        self.fps = None
        config = yaml.safe_load(open(os.path.join(folder, 'huetrackd.yaml')))
        volume = config['object_tracking']['volume']
        low, high = np.array(volume['min']), np.array(volume['max'])
        self.radius = next(iter(config['targets'].values()))['radius_m']
        times = {}
        with open(os.path.join(folder, 'groundtruth.csv')) as file:
            for row in csv.DictReader(file):
                frame, p = int(row['frame']), np.array([float(row[k]) for k in 'xyz'])
                seen = sum(float(v) > 0.5 for k, v in row.items() if k.startswith('vis_'))
                inside = bool(np.all(p >= low) and np.all(p <= high))
                times[frame] = float(row['t'])
                self.rows[frame][row['ball']] = (p, inside and seen >= 2, inside)
        frames = sorted(times)
        self.period = (times[frames[-1]] - times[frames[0]]) / max(1, frames[-1] - frames[0])
        self.last = max(frames)
        self.low, self.high = low, high


def read_tracks(path, truth):
    """frame -> {name: (position, state)}; of positions only."""
    out = defaultdict(dict)
    ends = {}
    with open(path) as file:
        for row in csv.DictReader(file):
            frame = round(float(row['t']) / truth.period)
            if row['state'] in ('tracking', 'coasting'):
                out[frame][row['target']] = (np.array([float(row[k]) for k in 'xyz']), row['state'])
            else:
                ends.setdefault(row['target'], frame)
    return out, ends


def figures(truth, tracks, first=0, verbose=False):
    """tracks: frame -> name -> (position, state)."""
    f = dict(gt=0, tp=0, fp=0, fn=0, switches=0, sq=0.0, worst=0.0, ghost=0, coasting=0)
    last_match, runs = {}, defaultdict(int)
    overlap, length = defaultdict(int), defaultdict(int)
    id_gt = defaultdict(int)
    wait, births = {}, []
    left = {}
    outside = 0
    for frame in range(0, truth.last + 1):
        balls = truth.rows.get(frame, {})
        told = {n: p for n, (p, s) in tracks.get(frame, {}).items() if s == 'tracking'}
        names, ids = list(told), list(balls)
        for p in told.values():
            outside += bool(np.any(p < truth.low - truth.radius) or np.any(p > truth.high + truth.radius))
        d = np.array([[np.linalg.norm(balls[b][0] - told[n]) for n in names] for b in ids]).reshape(len(ids), len(names))
        pairs = {}
        for i, b in enumerate(ids):  # who was matched stays so
            n = last_match.get(b)
            if n in told and d[i, names.index(n)] <= GATE_M and n not in pairs.values():
                pairs[b] = n
        rest_b = [b for b in ids if b not in pairs]
        rest_n = [n for n in names if n not in pairs.values()]
        sub = np.array([[d[ids.index(b), names.index(n)] for n in rest_n] for b in rest_b]).reshape(len(rest_b), len(rest_n))
        for i, j in matched(sub, GATE_M):
            pairs[rest_b[i]] = rest_n[j]
        for b, n in pairs.items():
            if b in last_match and last_match[b] != n:
                if frame >= first:
                    f['switches'] += 1
                if verbose:
                    print(f'      frame {frame}: {b} was {last_match[b]} and is {n}')
            last_match[b] = n
        near_any = {n for j, n in enumerate(names) if len(ids) and d[:, j].min() <= GATE_M}
        for n in names:
            runs[n] = 0 if n in near_any else runs[n] + 1
            if verbose and runs[n] == 1:
                print(f'      frame {frame}: {n} is near no ball: {told[n].round(3)}')
            f['ghost'] = max(f['ghost'], runs[n])
        for b in ids:
            counts = balls[b][1]
            if counts and b not in wait:
                wait[b] = frame
            if b in pairs and b in wait and wait[b] is not None:
                births.append(frame - wait[b])
                if verbose and births[-1] > 3:
                    print(f'      frame {frame}: {b} is told {births[-1]} sets after it was to be seen')
                wait[b] = None
        if frame < first:
            continue
        for b in ids:
            if not balls[b][1]:
                continue
            f['gt'] += 1
            id_gt[b] += 1
            if b in pairs:
                e = np.linalg.norm(balls[b][0] - told[pairs[b]])
                f['tp'] += 1
                f['sq'] += e * e
                f['worst'] = max(f['worst'], e)
            else:
                f['fn'] += 1
                if verbose:
                    states = {n: s for n, (p, s) in tracks.get(frame, {}).items() if np.linalg.norm(p - balls[b][0]) < GATE_M}
                    print(f'      frame {frame}: {b} is not tracked; near it: {states}')
        taken = {n: b for b, n in pairs.items()}
        for n in names:
            b = taken.get(n)
            counts_not = b is not None and not balls[b][1]
            if counts_not or (b is None and any(not balls[c][1] and d[ids.index(c), names.index(n)] <= GATE_M for c in ids)):
                continue
            if b is None:
                f['fp'] += 1
            length[n] += 1
            if b is not None:
                overlap[b, n] += 1
    bs, ns = sorted(id_gt), sorted(length)
    idtp = 0
    if bs and ns:
        gain = np.array([[overlap[b, n] for n in ns] for b in bs], float)
        cost = np.hstack([gain.max() - gain, np.full((len(bs), len(bs)), gain.max())])
        idtp = sum(gain[i, j] for i, j in zip(*linear_sum_assignment(cost)) if j < len(ns))
    f['idf1'] = 2 * idtp / max(1, f['gt'] + sum(length.values()))
    f['mota'] = 1 - (f['fn'] + f['fp'] + f['switches']) / max(1, f['gt'])
    f['cover'] = f['tp'] / max(1, f['gt'])
    f['rms_mm'] = 1e3 * math.sqrt(f['sq'] / max(1, f['tp']))
    f['births'] = max(births + [0])
    f['late_births'] = sum(b > 3 for b in births)
    f['never'] = sum(w is not None for w in wait.values())
    f['outside'] = outside
    # How long something is told, tracking or coasting, that no ball in the volume is near.
    f['ends_s'] = 0.0
    run = defaultdict(int)
    for frame in range(0, truth.last + 1):
        now = tracks.get(frame, {})
        inside = [r[0] for r in truth.rows.get(frame, {}).values() if r[2]]
        for n, (p, _) in now.items():
            is_there = any(np.linalg.norm(p - q) < GATE_M for q in inside)
            run[n] = 0 if is_there else run[n] + 1
            f['ends_s'] = max(f['ends_s'], run[n] * truth.period)
    f['objects'] = len({n for t in tracks.values() for n in t})
    return f


def huetrack(daemon, folder, count, extra):
    config = yaml.safe_load(open(os.path.join(folder, 'huetrackd.yaml')))
    for target in config['targets'].values():
        target['count'] = count
    config['rig'] = os.path.abspath(os.path.join(folder, config['rig']))
    for pair in extra:
        key, value = pair.split('=', 1)
        config['object_tracking'][key] = yaml.safe_load(value)
    with tempfile.TemporaryDirectory() as work:
        file, out = os.path.join(work, 'c.yaml'), os.path.join(work, 'tracks.csv')
        yaml.safe_dump(config, open(file, 'w'), sort_keys=False)
        done = subprocess.run([daemon, 'replay', file, folder, '--no-dds', '--quiet', '--tracks', out], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(done.stdout + done.stderr)
        truth = Truth(folder)
        keep = os.environ.get('MANY_KEEP')
        if keep:
            os.makedirs(keep, exist_ok=True)
            os.system(f'cp {out} {keep}/{os.path.basename(folder.rstrip("/"))}.csv')
        return truth, read_tracks(out, truth)[0]


class Opencv:
    """What a user would write: blobs of a threshold, points from pairs of views that a third confirms or none contradicts, and a
    Hungarian assignment to tracks that move evenly."""

    def __init__(self, folder, radius):
        import cv2
        self.cv2, self.radius = cv2, radius
        rig = yaml.safe_load(open(os.path.join(folder, 'rig.yaml')))['cameras']
        recording = yaml.safe_load(open(os.path.join(folder, 'recording.yaml')))['cameras']
        color = next(iter(yaml.safe_load(open(os.path.join(folder, 'huetrackd.yaml')))['targets'].values()))['color']
        self.low = np.array([color['hue_deg'][0] / 2, 255 * 0.3, 255 * 0.2])
        self.high = np.array([color['hue_deg'][1] / 2, 255, 255])
        self.cameras = []
        for name, c in rig.items():
            i = c['intrinsics']
            k = np.array([[i['fx'], 0, i['cx']], [0, i['fy'], i['cy']], [0, 0, 1.0]])
            r, t = np.array(c['cam_from_world']['rotation']), np.array(c['cam_from_world']['translation'])
            self.cameras.append((k, np.array(c['distortion'], float), np.hstack([r, t[:, None]]),
                                 cv2.VideoCapture(os.path.join(folder, recording[name]['frames']))))
        self.tracks, self.next = {}, 1

    def points(self):
        cv2, views = self.cv2, []
        for k, distortion, pose, video in self.cameras:
            ok, bgr = video.read()
            if not ok:
                return None
            mask = cv2.inRange(cv2.cvtColor(bgr, cv2.COLOR_BGR2HSV), self.low, self.high)
            n, _, stats, centres = cv2.connectedComponentsWithStats(mask)
            blobs = [(centres[b], stats[b, cv2.CC_STAT_AREA]) for b in range(1, n) if stats[b, cv2.CC_STAT_AREA] >= 20]
            und = cv2.undistortPoints(np.array([b[0] for b in blobs]).reshape(-1, 1, 2), k, distortion).reshape(-1, 2) if blobs else np.zeros((0, 2))
            views.append((pose, und, k[0, 0], [b[1] for b in blobs]))
        found = []
        for a in range(len(views)):
            for b in range(a + 1, len(views)):
                for i, x in enumerate(views[a][1]):
                    for j, y in enumerate(views[b][1]):
                        p = cv2.triangulatePoints(views[a][0], views[b][0], x.reshape(2, 1), y.reshape(2, 1)).ravel()
                        p = p[:3] / p[3]
                        used, error = [], 0.0
                        for v, (pose, und, f, _) in enumerate(views):
                            c = pose[:, :3] @ p + pose[:, 3]
                            if c[2] <= 0.1 or not len(und):
                                continue
                            d = f * np.linalg.norm(und - c[:2] / c[2], axis=1)
                            n = int(np.argmin(d))
                            if d[n] < 5:
                                used.append((v, n))
                                error += d[n]
                        if (a, i) in used and (b, j) in used:
                            found.append((-len(used), error / len(used), p, used))
        found.sort(key=lambda c: c[:2])
        taken, out = set(), []
        for _, _, p, used in found:
            if not any(u in taken for u in used):
                taken.update(used)
                out.append(p)
        return out

    def step(self, period):
        points = self.points()
        if points is None:
            return None
        names = list(self.tracks)
        d = np.array([[np.linalg.norm(self.tracks[n]['p'] + self.tracks[n]['v'] * self.tracks[n]['age'] - p) for p in points]
                      for n in names]).reshape(len(names), len(points))
        out, used = {}, set()
        pairs = dict(matched(d, 0.15))
        for i, n in enumerate(names):
            track = self.tracks[n]
            if i in pairs:
                p = points[pairs[i]]
                used.add(pairs[i])
                track.update(v=(p - track['p']) / track['age'], p=p, age=1)
                out[n] = (p, 'tracking')
            else:
                track['age'] += 1
                if track['age'] * period > 0.5:
                    del self.tracks[n]
        for j, p in enumerate(points):
            if j not in used:
                name = f'cv_{self.next}'
                self.next += 1
                self.tracks[name] = dict(p=p, v=np.zeros(3), age=1)
                out[name] = (p, 'tracking')
        return out


def opencv(folder, truth):
    tracker, out, frame = Opencv(folder, truth.radius), {}, 0
    while True:
        told = tracker.step(truth.period)
        if told is None:
            return out
        inside = {n: q for n, q in told.items() if np.all(q[0] >= truth.low - truth.radius) and np.all(q[0] <= truth.high + truth.radius)}
        out[frame] = inside
        frame += 1


COLUMNS = ('cover', 'switches', 'fp', 'idf1', 'mota', 'rms_mm', 'worst', 'births', 'late_births', 'never', 'ends_s', 'ghost', 'outside', 'objects')


def row(name, f):
    shown = [f'{100 * f["cover"]:7.2f}', f'{f["switches"]:4.0f}', f'{f["fp"]:5.0f}', f'{f["idf1"]:7.4f}', f'{f["mota"]:7.4f}',
             f'{f["rms_mm"]:7.2f}', f'{1e3 * f["worst"]:6.0f}', f'{f["births"]:5.0f}', f'{f["late_births"]:5.0f}', f'{f["never"]:5.0f}',
             f'{f["ends_s"]:6.2f}', f'{f["ghost"]:5.0f}', f'{f["outside"]:5.0f}', f'{f["objects"]:5.0f}']
    print(f'{name:26s}' + ' '.join(shown), flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('daemon')
    parser.add_argument('scenes', nargs='+')
    parser.add_argument('--no-opencv', action='store_true')
    parser.add_argument('--count')
    parser.add_argument('--set', action='append', default=[], help='object_tracking key=value')
    parser.add_argument('--verbose', action='store_true')
    o = parser.parse_args()
    print(f'{"scene":26s}cover % swi   fp    idf1    mota  rms_mm worst birth  late never ends_s ghost  out   objects')
    all_of = defaultdict(list)
    for folder in o.scenes:
        about = open(os.path.join(folder, 'truth.yaml')).readline()
        is_juggling = 'juggling' in about or 'gloves' in open(os.path.join(folder, 'truth.yaml')).read()
        count = o.count or (3 if is_juggling else 'up to 16')
        count = int(count) if str(count).isdigit() else count
        first = 9 if is_juggling else 0
        kind = 'juggling' if is_juggling else 'swarm'
        truth, tracks = huetrack(o.daemon, folder, count, o.set)
        f = figures(truth, tracks, first, o.verbose)
        row(os.path.basename(folder.rstrip('/')), f)
        all_of[kind].append(f)
        if not o.no_opencv:
            g = figures(truth, opencv(folder, truth), first)
            row('    OpenCV', g)
            all_of[kind + ' OpenCV'].append(g)
    for kind, some in all_of.items():
        if len(some) > 1:
            row(f'median, {kind}', {k: float(np.median([f[k] for f in some])) for k in COLUMNS})


if __name__ == '__main__':
    main()
