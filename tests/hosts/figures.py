#!/usr/bin/python3
"""Figures of cameras on other hosts: camera hosts in network namespaces, each with its own address, and trackers in others,
on a switch of the test's own (slow_network.c) that delays every packet by 0.2 ms and loses some. As root.
  tests/hosts/figures.py [--hosts N] [--cameras PER_HOST] [--seconds S] [--only NAME[,NAME...]]       8, 2, 20, all
Each figure is printed beside its bar; exit status 1: one was missed; 77: namespaces are not allowed here.
Needs a build in build/release (targets film_host, huetrackd, huetrack), gcc and numpy. Only addresses of these namespaces are
ever sent to. What else runs on the machine is in the figures: leave it alone meanwhile."""
import argparse
import collections
import csv
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
FILM_HOST = ROOT / "build/release/tests/soak/film_host"
HUETRACKD = ROOT / "build/release/service/daemon/huetrackd"
HUETRACK = ROOT / "build/release/clients/huetrack/huetrack"
DOMAIN = 77
FPS = 30
PERIOD_NS = round(1e9 / FPS)  # of the films
DELAY_US = 200
SLOW_QUEUE = 256_000  # bytes that wait for a slow link
TICKS = os.sysconf("SC_CLK_TCK")


def ip(*words, check=True):
    return subprocess.run(["ip", *words], check=check, capture_output=True, text=True)


class Figures:
    """What was measured, and whether it is what it must be."""

    def __init__(self):
        self.missed = 0

    def tell(self, what, value, unit="", bar=None, least=False):
        said = f"{value:.3g}" if isinstance(value, float) else str(value)
        verdict = ""
        if bar is not None:
            good = value is not None and (value >= bar if least else value <= bar)
            self.missed += not good
            verdict = f"   (bar: {'at least' if least else 'at most'} {bar}{' ' + unit if unit else ''})" + (
                "" if good else "   MISSED")
        print(f"  {what}: {said}{' ' + unit if unit else ''}{verdict}", flush=True)


class Network:
    """Namespaces ht-0, ht-1, ..., each with eth0, and the switch between them in this one."""

    def __init__(self, count, lost_per_million, folder, has_multicast=True, slow_mbit=None):
        self.count = count
        for n in range(count):
            ip("netns", "add", f"ht-{n}")
            ip("link", "add", f"ht-b{n}", "type", "veth", "peer", "name", "eth0", "netns", f"ht-{n}")
            ip("link", "set", f"ht-b{n}", "up")
            ip("-n", f"ht-{n}", "addr", "add", f"10.77.0.{n + 1}/24", "dev", "eth0")
            ip("-n", f"ht-{n}", "link", "set", "eth0", "up")
            ip("-n", f"ht-{n}", "link", "set", "lo", "up")
            ip("-n", f"ht-{n}", "route", "add", "default", "dev", "eth0")  # for multicast
        options = [] if has_multicast else ["--no-multicast"]
        if slow_mbit:
            options += ["--slow", f"ht-b1,{1000 * slow_mbit},{SLOW_QUEUE}"]
        self.switch = subprocess.Popen(
            [folder / "slow_network", *options, str(DELAY_US), str(lost_per_million), "1", *(f"ht-b{n}" for n in range(count))],
            stdout=subprocess.PIPE, text=True)
        self.processes = [self.switch]

    def run(self, n, words, log, env=None, boot_id=None):
        """In namespace n. boot_id: a file that is shown as the machine's, which makes it another one."""
        words = [str(w) for w in words]
        if boot_id:
            words = ["sh", "-c", f'mount --bind {boot_id} /proc/sys/kernel/random/boot_id && exec "$0" "$@"', *words]
        process = subprocess.Popen(["ip", "netns", "exec", f"ht-{n}", *words], stdout=open(log, "w"),
                                   stderr=subprocess.STDOUT, env={**os.environ, **(env or {})})
        self.processes.append(process)
        return process

    def cut(self, n, is_cut):
        ip("-n", f"ht-{n}", "link", "set", "eth0", "down" if is_cut else "up")
        if not is_cut:
            ip("-n", f"ht-{n}", "route", "add", "default", "dev", "eth0")

    def slow_down(self, is_slow):
        self.switch.send_signal(signal.SIGUSR1 if is_slow else signal.SIGUSR2)

    def close(self):
        for process in reversed(self.processes):
            if process.poll() is None:
                process.terminate()
        for process in self.processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
        for n in range(self.count):
            ip("netns", "del", f"ht-{n}", check=False)
            ip("link", "del", f"ht-b{n}", check=False)


class Hall:
    """N camera hosts with films for cameras, in namespaces 1.. N, and places for trackers from 0 and N + 1 on."""

    def __init__(self, folder, hosts, per_host, lost_per_million=0, trackers=1, has_multicast=True, slow_mbit=None):
        """slow_mbit: Network.slow_down() has the first host's frames go at that rate."""
        self.folder, self.hosts, self.per_host = folder, hosts, per_host
        self.films = folder / f"films-{hosts * per_host}"
        if not self.films.exists():
            subprocess.run([FILM_HOST, "--make", str(hosts * per_host), self.films], check=True)
        self.names = [f"cam{c}" for c in range(hosts * per_host)]
        self.network = Network(hosts + trackers, lost_per_million, folder, has_multicast, slow_mbit)
        self.running = {}
        self.profiles = {}  # XML of a host, or of who takes from them, by name

    def host_of(self, camera):
        return camera // self.per_host + 1

    def bus(self, name):
        profile = f", profile: {self.profiles[name]}" if name in self.profiles else ""
        return f"dds: {{domain: {DOMAIN}{profile}}}\n"

    def start_host(self, n, wrong_clock=None, is_spread=False, is_ready_made=False):
        """wrong_clock: (seconds ahead, ppm fast). is_spread: the cameras of the hall expose one after the other.
        is_ready_made: what matches in the film is found out once."""
        name = f"host-{n}"
        file = self.folder / f"{name}.yaml"
        cameras = "".join(f"  cam{c}: {{device: /dev/film/cam{c}, size: [640, 480], format: mjpeg, fps: {FPS}}}\n"
                          for c in range((n - 1) * self.per_host, n * self.per_host))
        file.write_text(f"version: 1\nhost: {name}\n{self.bus(name)}cameras:\n{cameras}")
        words = [FILM_HOST, "--dequeued", self.folder / f"{name}.csv", self.films, file]
        env, boot_id = None, None
        if is_spread:
            words[1:1] = ["--spread", str(len(self.names))]
        if is_ready_made:
            words[1:1] = ["--ready-made", "65,115"]
        if wrong_clock:
            start_s = time.clock_gettime(time.CLOCK_MONOTONIC)
            env = {"LD_PRELOAD": str(self.folder / "wrong_clock.so"),
                   "WRONG_CLOCK": f"{start_s} {wrong_clock[0]} {wrong_clock[1]}"}
            words[1:1] = ["--clock", f"{start_s},{wrong_clock[1]}"]
            boot_id = self.folder / f"{name}.boot_id"
            boot_id.write_text(f"{n:08x}-0000-4000-8000-000000000000\n")
        self.running[n] = self.network.run(n, words, self.folder / f"{name}.log", env, boot_id)
        return self.running[n]

    def tracker_config(self, name="tracker", cameras=None, more="", of_camera="", of_target=""):
        file = self.folder / f"{name}.yaml"
        cameras = range(len(self.names)) if cameras is None else cameras
        file.write_text(f"version: 1\nrig: {self.films / 'rig.yaml'}\ntargets: {{lime: {{{of_target}color: {{hue_deg: [65, 115]}}}}}}\n"
                        f"{self.bus(name)}{more}cameras:\n" +
                        "".join(f"  cam{c}: {{host: host-{self.host_of(c)}, camera: cam{c}{of_camera}}}\n" for c in cameras))
        return file

    def receive(self, at=0, name="received"):
        return self.network.run(at, [FILM_HOST, "--receive", self.folder / f"{name}.csv", self.films, self.tracker_config()],
                                self.folder / f"{name}.log")

    def track(self, config, at=0, name="tracks"):
        return self.network.run(at, [HUETRACKD, "run", config, "--tracks", self.folder / f"{name}.csv"],
                                self.folder / f"{name}.log")

    def statuses(self, at=0):
        out = subprocess.run(["ip", "netns", "exec", f"ht-{at}", HUETRACK, "status", "--format", "json"],
                             capture_output=True, text=True, env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}, timeout=20)
        return [json.loads(line) for line in out.stdout.splitlines()]

    def end(self, process):
        process.send_signal(signal.SIGINT)
        process.wait(20)

    def close(self):
        self.network.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def times_of(file):
    """By camera: stamps and when they were there, both in seconds, ascending."""
    rows = collections.defaultdict(list)
    with open(file) as lines:
        for row in csv.DictReader(lines):
            if row["at_ns"]:
                rows[row["camera"]].append((int(row["stamp_ns"]), int(row["at_ns"])))
    return {camera: np.array(sorted(r), dtype=np.int64) for camera, r in rows.items()}


def matched(sent, received, within_ns=5_000_000):
    """Rows of sent with the row of received that has their stamp: (index, latency in ms)."""
    if len(received) == 0:
        return np.zeros(0, int), np.zeros(0)
    near = np.clip(np.searchsorted(received[:, 0], sent[:, 0]), 1, max(1, len(received) - 1))
    near = np.where(np.abs(received[near - 1, 0] - sent[:, 0]) < np.abs(received[np.minimum(near, len(received) - 1), 0] -
                                                                       sent[:, 0]), near - 1,
                    np.minimum(near, len(received) - 1))
    good = np.abs(received[near, 0] - sent[:, 0]) < within_ns
    return np.flatnonzero(good), 1e-6 * (received[near[good], 1] - sent[good, 1])


def cpu_s(process):
    """Of the process and what it became (ip netns exec replaces itself)."""
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def unix_now_ns():
    return time.time_ns()


def compare(hall, from_ns, to_ns, name="received"):
    """Between two moments: latencies in ms of all frames, and the share that did not come."""
    received = times_of(hall.folder / f"{name}.csv")
    latencies, frames, lost, longest_gap_s = [], 0, 0, 0.0
    for n in range(1, hall.hosts + 1):
        for camera, sent in times_of(hall.folder / f"host-{n}.csv").items():
            sent = sent[(sent[:, 1] >= from_ns) & (sent[:, 1] < to_ns)]
            came, latency = matched(sent, received.get(camera, np.zeros((0, 2), np.int64)))
            frames += len(sent)
            lost += len(sent) - len(came)
            latencies.append(latency)
            if len(came) > 1:
                longest_gap_s = max(longest_gap_s, 1e-9 * float(np.diff(sent[came, 0]).max()))
    return np.concatenate(latencies), frames, lost, longest_gap_s


def settle(hall, receiver, seconds=8):
    """Until all are found and all clocks known."""
    time.sleep(seconds)
    assert receiver.poll() is None, "the receiver ended"


def latency_and_loss(figures, options, folder):
    for per_million, most_lost in ((0, 0.0), (1000, 0.5)):
        print(f"== {options.hosts} hosts x {options.cameras} MJPEG cameras of 640x480 at {FPS} fps, {DELAY_US / 1000} ms each way, "
              f"{per_million / 1e4} % of packets lost")
        with Hall(folder, options.hosts, options.cameras, per_million) as hall:
            for n in range(1, options.hosts + 1):
                hall.start_host(n, is_spread=True)
            receiver = hall.receive()
            settle(hall, receiver)
            began, cpu = unix_now_ns(), {n: cpu_s(p) for n, p in hall.running.items()}
            network_cpu, tracker_cpu = cpu_s(hall.network.switch), cpu_s(receiver)
            time.sleep(options.seconds)
            ended = unix_now_ns()
            took = 1e-9 * (ended - began)
            shares = [(cpu_s(p) - cpu[n]) / took for n, p in hall.running.items()]
            network_share = (cpu_s(hall.network.switch) - network_cpu) / took
            tracker_share = (cpu_s(receiver) - tracker_cpu) / took
            time.sleep(1)
            hall.end(receiver)
            latencies, frames, lost, _ = compare(hall, began, ended)
            figures.tell("frames", frames)
            figures.tell("lost", 100 * lost / frames, "% of frames", most_lost)
            decoding_ms = next(json.loads(line)["decoding_ms"] for line in (folder / "received.log").read_text().splitlines()
                               if line.startswith("{"))
            latencies -= decoding_ms  # which follows a dequeue at a camera of the tracker's own, too
            bars = (2, 6) if per_million == 0 else (None, None)
            figures.tell("from a host's dequeue to the tracker's, p50", float(np.median(latencies)), "ms", bars[0])
            figures.tell("the same, p99", float(np.percentile(latencies, 99)), "ms", bars[1])
            figures.tell("decoding, which follows either", float(decoding_ms), "ms")
            if per_million == 0:
                figures.tell(f"a capture host with {options.cameras} cameras, on average", 100 * float(np.mean(shares)),
                             "% of a core", 10 if options.cameras == 2 else None)
                figures.tell("who receives and decodes them", 100 * tracker_share, "% of a core")
                figures.tell("the switch", 100 * network_share, "% of a core")


def first_after(hall, camera, moment_ns):
    rows = times_of(hall.folder / "received.csv").get(camera, np.zeros((0, 2), np.int64))
    rows = rows[rows[:, 1] > moment_ns]
    return None if len(rows) == 0 else 1e-9 * float(rows[:, 1].min() - moment_ns)


def outages(figures, options, folder):
    print(f"== outages: {options.hosts} hosts x {options.cameras} cameras")
    with Hall(folder, options.hosts, options.cameras) as hall:
        for n in range(1, options.hosts + 1):
            hall.start_host(n)
        receiver = hall.receive()
        settle(hall, receiver)
        began = unix_now_ns()
        hall.running[1].kill()
        time.sleep(5)
        shutil.copy(folder / "host-1.csv", folder / "host-1.before.csv")
        again = unix_now_ns()
        hall.start_host(1)
        time.sleep(8)
        cut = unix_now_ns()
        hall.network.cut(1, True)
        time.sleep(10)
        joined = unix_now_ns()
        hall.network.cut(1, False)
        time.sleep(8)
        ended = unix_now_ns()
        hall.end(receiver)
        back = [first_after(hall, f"cam{c}", again) for c in range(options.cameras)]
        figures.tell("a host killed with -9: from its start until all its frames come again",
                     max(b if b is not None else 1e9 for b in back), "s", 3)
        back = [first_after(hall, f"cam{c}", joined) for c in range(options.cameras)]
        figures.tell("its cable pulled for 10 s: from the plug until all its frames come again",
                     max(b if b is not None else 1e9 for b in back), "s", 3)
        hall.hosts -= 1  # the others
        others, frames, lost, gap_s = [], 0, 0, 0.0
        received = times_of(folder / "received.csv")
        for n in range(2, options.hosts + 1):
            for camera, sent in times_of(folder / f"host-{n}.csv").items():
                sent = sent[(sent[:, 1] >= began) & (sent[:, 1] < ended - 1_000_000_000)]
                came, latency = matched(sent, received[camera])
                others.append(latency)
                frames, lost = frames + len(sent), lost + len(sent) - len(came)
                gap_s = max(gap_s, 1e-9 * float(np.diff(sent[came, 0]).max()))
        if others:
            figures.tell("meanwhile the others' frames lost", 100 * lost / frames, "%", 0.0)
            figures.tell("their longest gap", 1000 * gap_s, "ms")
            figures.tell("their latency, p99", float(np.percentile(np.concatenate(others), 99)), "ms")


def slow_network(figures, options, folder):
    seconds = max(5, options.seconds / 2)
    for mbit, most_lost, most_ms in ((40, 1.0, 250), (20, 45.0, 250)):
        print(f"== a host with two cameras by {mbit} Mbit/s, where {SLOW_QUEUE // 1000} kB wait at most; another one beside it")
        with Hall(folder, 2, 2, slow_mbit=mbit) as hall:
            for n in (1, 2):
                hall.start_host(n, is_spread=True)
            receiver = hall.receive()
            settle(hall, receiver)
            hall.network.slow_down(True)
            time.sleep(3)
            began = unix_now_ns()
            time.sleep(seconds)
            ended = unix_now_ns()
            time.sleep(1)
            hall.network.slow_down(False)
            time.sleep(3)
            fast = unix_now_ns()
            time.sleep(5)
            end = unix_now_ns()
            time.sleep(1)
            hall.end(receiver)
            hall.end(hall.running[1])
            said = (folder / "host-1.log").read_text()
            left_out = sum(int(n) for n in re.findall(r"(\d+) left out for a slow network", said))
            hall.hosts = 1  # the slow one
            latencies, frames, lost, gap_s = compare(hall, began, ended)
            figures.tell("frames lost", 100 * lost / frames, "% of frames", most_lost)
            figures.tell("latency, p50", float(np.median(latencies)), "ms")
            figures.tell("  p99", float(np.percentile(latencies, 99)), "ms", most_ms)
            figures.tell("  longest gap between two frames of a camera", 1000 * gap_s, "ms")
            figures.tell("frames that the host counts as left out", left_out)
            _, frames, lost, _ = compare(hall, fast, end)
            figures.tell("lost from 3 s after it is fast again", 100 * lost / frames, "% of frames", 0.0)


def two_trackers(figures, options, folder):
    print("== two trackers on one camera host with two cameras")
    with Hall(folder, 1, 2, trackers=2) as hall:
        host = hall.start_host(1)
        receivers = [hall.receive(0, "received")]
        settle(hall, receivers[0])
        before, began = cpu_s(host), unix_now_ns()
        time.sleep(options.seconds / 2)
        alone = (cpu_s(host) - before) / (1e-9 * (unix_now_ns() - began))
        receivers.append(hall.receive(2, "second"))
        settle(hall, receivers[1])
        before, began = cpu_s(host), unix_now_ns()
        time.sleep(options.seconds / 2)
        both = (cpu_s(host) - before) / (1e-9 * (unix_now_ns() - began))
        ended = unix_now_ns()
        time.sleep(1)
        for receiver in receivers:
            hall.end(receiver)
        for name in ("received", "second"):
            latencies, frames, lost, _ = compare(hall, began, ended, name)
            figures.tell(f"tracker {name}: lost of {frames} frames", 100 * lost / frames, "%", 0.0)
            figures.tell(f"tracker {name}: latency p99", float(np.percentile(latencies, 99)), "ms")
        figures.tell("the host, with one tracker", 100 * alone, "% of a core", 10)
        figures.tell("with two", 100 * both, "% of a core")


DISCOVERY_SERVER = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <profiles>
    <participant profile_name="huetrack" is_default_profile="true">
      <rtps>
        <prefix>44.53.00.5f.45.50.52.4f.53.49.4d.41</prefix>
        <builtin>
          <discovery_config><discoveryProtocol>SERVER</discoveryProtocol></discovery_config>
          <metatrafficUnicastLocatorList>
            <locator><udpv4><address>10.77.0.1</address><port>11811</port></udpv4></locator>
          </metatrafficUnicastLocatorList>
        </builtin>
      </rtps>
    </participant>
  </profiles>
</dds>
"""


def give_keys(hall):
    members = ["tracker:service", *(f"host-{n}:host" for n in range(1, hall.hosts + 1))]
    shutil.rmtree(hall.folder / "keys", ignore_errors=True)
    subprocess.run(["bash", ROOT / "configs/dds/secure.sh", hall.folder / "keys", *members], check=True, capture_output=True)
    hall.profiles = {m.split(":")[0]: hall.folder / "keys" / m.split(":")[0] / "huetrack.xml" for m in members}


def give_discovery_server(hall):
    """Of huetrack's own, at the tracker: as `fastdds discovery` is one."""
    server, client = hall.folder / "server.xml", hall.folder / "client.xml"
    server.write_text(DISCOVERY_SERVER)
    client.write_text((ROOT / "configs/dds/discovery_server.xml").read_text().replace("192.0.2.10", "10.77.0.1"))
    hall.network.run(0, [HUETRACK, "watch", "--profiles", server, "--domain", DOMAIN], hall.folder / "server.log")
    hall.profiles = {name: client for name in ("tracker", *(f"host-{n}" for n in range(1, hall.hosts + 1)))}


def profiles(figures, options, folder):
    """Kernels keep what came of a large datagram for 30 s: what goes wrong does so after some ten seconds."""
    for what, give, has_multicast in (
            ("keys of configs/dds/secure.sh", give_keys, True),
            ("a network without multicast, configs/dds/discovery_server.xml", give_discovery_server, False)):
        print(f"== {what}: 2 hosts x 2 cameras, 0.1 % of packets lost")
        with Hall(folder, 2, 2, 1000, has_multicast=has_multicast) as hall:
            give(hall)
            for n in (1, 2):
                hall.start_host(n, is_spread=True)
            receiver = hall.receive()
            settle(hall, receiver)
            began = unix_now_ns()
            time.sleep(options.seconds)
            ended = unix_now_ns()
            time.sleep(1)
            hall.end(receiver)
            latencies, frames, lost, _ = compare(hall, began, ended)
            figures.tell("frames", frames, "", 4 * FPS * options.seconds * 0.98, least=True)
            figures.tell("lost", 100 * lost / frames if frames else None, "% of frames", 0.5)
            figures.tell("latency, p99", float(np.percentile(latencies, 99)) if len(latencies) else None, "ms")


def track_of(file):
    rows = [(float(r["t"]), float(r["x"]), float(r["y"]), float(r["z"])) for r in csv.DictReader(open(file))
            if r["state"] == "tracking"]
    return np.array(rows)


def truth(t_monotonic):
    """The ball of films.h."""
    angle = np.pi * t_monotonic * (1e9 / FPS / PERIOD_NS)
    return np.stack([0.4 * np.cos(angle), 0.4 * np.sin(angle), 1 + 0.2 * np.sin(2 * angle)], axis=1)


def clocks(figures, options, folder):
    off_s, ppm = 0.040, 50
    print(f"== a camera host whose clock is {1000 * off_s:.0f} ms ahead and {ppm} ppm fast, another {1000 * off_s:.0f} ms behind")
    with Hall(folder, 4, 1) as hall:
        hall.start_host(1, wrong_clock=(off_s, ppm))
        hall.start_host(2, wrong_clock=(-off_s, -ppm))
        hall.start_host(3)
        hall.start_host(4)
        time.sleep(2)
        zero_ns = time.time_ns() - time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        began = unix_now_ns()
        receiver = hall.receive()
        recordings = pathlib.Path(tempfile.mkdtemp(dir=folder))
        wrong = hall.track(hall.tracker_config("wrong", [0, 1], f"record: {{folder: {recordings}, always: true}}\n"),
                           name="wrong_tracks")
        true = hall.track(hall.tracker_config("true", [2, 3]), name="true_tracks")
        time.sleep(12)
        statuses = [s for s in hall.statuses() if s["clocks"]]
        time.sleep(options.seconds)
        for process in (receiver, wrong, true):
            hall.end(process)
        for camera in ("cam0", "cam1"):
            rows = times_of(folder / "received.csv")[camera]
            rows = rows[rows[:, 1] > began + 10_000_000_000]
            phase = (rows[:, 0] - zero_ns) % PERIOD_NS
            error = np.minimum(phase, PERIOD_NS - phase)
            figures.tell(f"error of {camera}'s stamps, later than 10 s after the start", 1e-6 * float(error.max()), "ms", 0.5)
            figures.tell("stamped before it came by, at most", 1e-6 * float((rows[:, 1] - rows[:, 0]).max()), "ms")
        for status in statuses:
            for clock in status["clocks"]["clocks"]:
                figures.tell(f"status says of {clock['host']}", f"{1000 * clock['offset_s']:.3f} ms +- "
                             f"{1000 * clock['sigma_s']:.3f}, {clock['drift_ppm']:.0f} ppm")
        recording = next(recordings.iterdir())
        subprocess.run([HUETRACKD, "replay", folder / "wrong.yaml", recording, "--no-dds", "--tracks", folder / "again.csv"],
                       check=True, capture_output=True)
        live, again = ((folder / name).read_text().splitlines() for name in ("wrong_tracks.csv", "again.csv"))
        figures.tell("rows of the track that its replay has, too", f"{len(set(live) & set(again))} of {len(live)}, {len(again)}")
        figures.tell("rows that differ", len(set(live) ^ set(again)), "", 0)
        with open(next(recording.glob("cam0*.csv"))) as rows:
            sigmas = [int(row["clock_sigma_ns"]) for row in csv.DictReader(rows)]
        figures.tell("uncertainties of the clock that it recorded", f"{min(sigmas) / 1e6:.3f} to {max(sigmas) / 1e6:.3f} ms")
        tracks = {}
        for name in ("wrong", "true"):
            track = track_of(folder / f"{name}_tracks.csv")
            track = track[track[:, 0] > 1e-9 * began + 12]
            off = track[:, 1:] - truth(track[:, 0] - 1e-9 * zero_ns)
            tracks[name] = off - off.mean(axis=0)
            figures.tell(f"rms of the track by {name} clocks", 1000 * float(np.sqrt((off ** 2).sum(axis=1).mean())), "mm")
        rms = {name: 1000 * float(np.sqrt((off ** 2).sum(axis=1).mean())) for name, off in tracks.items()}
        figures.tell("more than by true clocks", rms["wrong"] - rms["true"], "mm", 1)


def scale(figures, options, folder):
    print("== what each further camera costs, tracked by huetrackd (one ball), two cameras a host")
    counts, tracker, hosts = [], [], []
    for count in (2, 4, 8, 16):
        with Hall(folder, count // 2, 2) as hall:
            for n in range(1, count // 2 + 1):
                hall.start_host(n)
            process = hall.track(hall.tracker_config())
            time.sleep(10)
            cpu, host_cpu, began = cpu_s(process), [cpu_s(p) for p in hall.running.values()], time.monotonic()
            time.sleep(options.seconds / 2)
            took = time.monotonic() - began
            counts.append(count)
            tracker.append(100 * (cpu_s(process) - cpu) / took)
            hosts.append(100 * float(np.mean([cpu_s(p) - c for p, c in zip(hall.running.values(), host_cpu)])) / took)
            status = hall.statuses()[0]["status"]
            resident = next(int(line.split()[1]) / 1024 for line in
                            pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines() if line.startswith("VmRSS"))
            figures.tell(f"{count} cameras: the tracker", tracker[-1], "% of a core")
            figures.tell("  a capture host", hosts[-1], "% of a core")
            figures.tell("  sets per second", float(status["set_rate_hz"]), "", 29, least=True)
            figures.tell("  the tracker's memory", resident, "MB")
    slope, rest = np.polyfit(counts, tracker, 1)
    figures.tell("each further camera, of the tracker", float(slope), "% of a core")
    figures.tell("  that is, per frame", float(slope) / 100 / FPS * 1000, "ms")
    figures.tell("beside that", float(rest), "% of a core")


def frames_of(status):
    return sum(camera["frames"] for camera in status["cameras"])


def sent_by(log):
    """Frames and bytes, as a host says at its end."""
    frames, bytes_ = 0, 0.0
    for line in log.read_text().splitlines():
        said = re.search(r"camera \S+: (\d+) frames sent, ([0-9.]+) MB", line)
        if said:
            frames, bytes_ = frames + int(said[1]), bytes_ + 1e6 * float(said[2])
    return frames, bytes_


def matches(figures, options, folder):
    print("== send: matches: one ball, 640x480, two cameras on one host, a picture a second")
    zero_ns = time.time_ns() - time.clock_gettime_ns(time.CLOCK_MONOTONIC)
    for name, every_s, shape, per_million in (
            ("with a picture a second", 1, "blob", 0), ("without pictures", 0, "blob", 0),
            ("with the pixels around the ball, and a picture a second", 1, "ball", 0),
            ("the same, 1 % of packets lost", 1, "ball", 10000)):
        with Hall(folder, 1, 2, per_million) as hall:
            host = hall.start_host(1)
            config = hall.tracker_config(of_camera=f", send: matches, picture_every_s: {every_s}",
                                         of_target=f"shape: {shape}, ")
            process = hall.track(config)
            time.sleep(8)
            cpu, began = cpu_s(host), time.monotonic()
            time.sleep(options.seconds)
            share = (cpu_s(host) - cpu) / (time.monotonic() - began)
            cameras = hall.statuses()[0]["status"]["cameras"]
            dropped, came = (sum(camera[key] for camera in cameras) for key in ("dropped", "frames"))
            hall.end(process)
            hall.end(host)
            frames, bytes_ = sent_by(folder / "host-1.log")
            rows = track_of(folder / "tracks.csv")
            figures.tell(f"a frame, {name}", bytes_ / frames / 1000, "kB", 6)
            figures.tell("  frames sent", frames)
            figures.tell("  lost on the way", 100 * dropped / (came + dropped), "% of frames", 0.5)
            figures.tell("  positions", len(rows))
            off = rows[:, 1:] - truth(rows[:, 0] - 1e-9 * zero_ns)
            off = off[len(off) // 4:] - off[len(off) // 4:].mean(axis=0)
            figures.tell("  rms of the track", 1000 * float(np.sqrt((off ** 2).sum(axis=1).mean())), "mm")
            figures.tell("  the host, which decodes", 100 * share, "% of a core")
    cost_of_matches(figures, options, folder, "blob", (2, 8, 16, 32, 64))
    cost_of_matches(figures, options, folder, "ball", (2, 8, 16))


def cost_of_matches(figures, options, folder, shape, counts):
    """The slope over the cameras. Outlines are fitted in pixels that the hosts cut out of what they decode, which two cores do not
    do for more than 16 cameras; without them what matches is found out once, and sent again and again."""
    is_ready_made = shape == "blob"
    print(f"== send: matches: what each further camera costs the tracker, shape: {shape}"
          f"{'; what matches is ready-made' if is_ready_made else ''}")
    # How often the tracker wakes hangs on how the cameras' moments fall, which each start shuffles: of few cameras by a third.
    starts = 3 if counts[-1] <= 16 else 1
    per_set_ms = []
    for count in counts:
        hosts = min(8, count // 2)
        runs = [run_of_matches(options, folder, shape, count, hosts, is_ready_made) for _ in range(starts)]
        mean = {key: float(np.mean([run[key] for run in runs])) for key in runs[0]}
        per_set_ms.append(count * mean["ms"])
        each = ", ".join(f"{run['ms']:.3g}" for run in runs)
        figures.tell(f"{count} cameras on {hosts} hosts: the tracker{f' (mean of {each})' if starts > 1 else ''}", mean["ms"],
                     "ms of CPU a frame")
        figures.tell("  of a core", mean["core"], "%")
        figures.tell("  frames", mean["frames"], "% of what the cameras give")
        figures.tell("  its memory", mean["memory"], "MB")
    slope, rest = np.polyfit(counts, per_set_ms, 1)
    figures.tell("each further camera, of the tracker", float(slope), "ms of CPU a frame", 0.15)
    figures.tell("  beside that, per set", float(rest), "ms")


def run_of_matches(options, folder, shape, count, hosts, is_ready_made):
    with Hall(folder, hosts, count // hosts) as hall:
        for n in range(1, hosts + 1):
            hall.start_host(n, is_ready_made=is_ready_made)
        process = hall.track(hall.tracker_config(of_camera=", send: matches", of_target=f"shape: {shape}, "))
        time.sleep(12 + count / 4)
        before, cpu, began = hall.statuses()[0]["status"], cpu_s(process), time.monotonic()
        time.sleep(options.seconds)
        after = hall.statuses()[0]["status"]
        spent, took = cpu_s(process) - cpu, time.monotonic() - began
        frames = frames_of(after) - frames_of(before)
        resident = next(int(line.split()[1]) / 1024 for line in
                        pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines() if line.startswith("VmRSS"))
        return {"ms": 1000 * spent / frames, "core": 100 * spent / took, "frames": 100 * frames / (took * count * FPS),
                "memory": resident}


ALL = {"latency": latency_and_loss, "outages": outages, "slow": slow_network, "two": two_trackers, "profiles": profiles,
       "clocks": clocks, "scale": scale, "matches": matches}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hosts", type=int, default=8)
    parser.add_argument("--cameras", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--only", default=",".join(ALL), help=", ".join(ALL))
    parser.add_argument("--keep", type=pathlib.Path, help="an empty folder for logs and what was measured")
    options = parser.parse_args()
    if os.geteuid() != 0 or ip("netns", "add", "ht-try", check=False).returncode != 0:
        print("SKIP: network namespaces need root, and a kernel that has them")
        return 77
    ip("netns", "del", "ht-try")
    folder = options.keep or pathlib.Path(tempfile.mkdtemp(prefix="huetrack-hosts-"))
    folder.mkdir(exist_ok=True)
    sources = ROOT / "tests/hosts"
    subprocess.run(["gcc", "-O2", "-o", folder / "slow_network", sources / "slow_network.c"], check=True)
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "-o", folder / "wrong_clock.so", sources / "wrong_clock.c", "-ldl"],
                   check=True)
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores before it begins")
    figures = Figures()
    try:
        for name in options.only.split(","):
            ALL[name](figures, options, folder)
    finally:
        if not options.keep:
            shutil.rmtree(folder, ignore_errors=True)
    print(f"{figures.missed} figure{'s' if figures.missed != 1 else ''} missed")
    return 1 if figures.missed else 0


if __name__ == "__main__":
    sys.exit(main())
