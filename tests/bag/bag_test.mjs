// A rosbag2 and an MCAP of `huetrack export`, decoded message by message by readers that are not ours, and held to the CSV.
//   exit 0: passed, 77: skipped (npm's packages are not there), anything else: failed
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const options = {};
for (let i = 2; i + 1 < process.argv.length; i += 2) options[process.argv[i].slice(2)] = process.argv[i + 1];
if (!existsSync(join(options.modules, "node_modules/@mcap/core"))) {
  console.log("skipped: the packages of tests/bag are not installed");
  process.exit(77);
}
const require = createRequire(join(options.modules, "package.json"));
const { Rosbag2 } = require("@foxglove/rosbag2");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const yaml = require("js-yaml");
const initSqlJs = require("sql.js");

const folder = mkdtempSync(join(tmpdir(), "huetrack-bag-"));
const file = (name) => join(folder, name);
function huetrack(...args) {
  const { status, stdout, stderr } = spawnSync(options.huetrack, args, { encoding: "utf8" });
  return { status, stdout, stderr };
}
function exported(...args) {
  const result = huetrack("export", ...args);
  assert.equal(result.status, 0, result.stderr);
  return result.stdout;
}

// ---- Tracks as ours: two objects, some rows without a position; enough for several chunks.
const rows = [];
const base = 1700000000n * 1000000000n;
for (let k = 0; k < 3000; k++)
  for (const target of ["ball_1", "lime"]) {
    const ns = base + BigInt(k) * 33333333n + (target === "lime" ? 1234567n : 0n);
    const has = !(target === "lime" && k % 7 === 0);
    const n = k / 1000 + (target === "lime" ? 10 : 0);
    rows.push({ target, ns, has, p: [n, -1.25 - n, 0.1 * n], c: [1e-6 + n * 1e-9, 2e-7, 3e-7, 4e-6, 5e-7, 9e-6] });
  }
const seconds = (ns) => `${ns / 1000000000n}.${String(ns % 1000000000n).padStart(9, "0")}`;
const text = (row) => [row.target, seconds(row.ns), ...(row.has ? [...row.p, 1, 2, 3, ...row.c] : Array(12).fill("nan")), row.has ? "tracking" : "lost", 2, 0.9].join(",");
writeFileSync(file("tracks.csv"), ["target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence", ...rows.map(text), ""].join("\n"));

const stampOf = (ns) => ({ sec: Number(ns / 1000000000n), nsec: Number(ns % 1000000000n) });
const full = ([xx, xy, xz, yy, yz, zz]) => {
  const c = Array(36).fill(0);
  [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].forEach((line, i) => line.forEach((v, j) => (c[6 * i + j] = v)));
  for (const i of [21, 28, 35]) c[i] = 1e6;
  return c;
};
// What must come, by topic.
function expectedOf(list, name) {
  return list.filter((row) => row.target === name && row.has);
}
function checkPose(message, row, frame = "world", orientation = { x: 0, y: 0, z: 0, w: 1 }, covariance = full(row.c)) {
  assert.deepEqual({ sec: message.header.stamp.sec, nsec: message.header.stamp.nsec ?? message.header.stamp.nanosec }, stampOf(row.ns));
  assert.equal(message.header.frame_id, frame);
  const { x, y, z } = message.pose.pose.position;
  assert.deepEqual([x, y, z], row.p);
  assert.deepEqual({ ...message.pose.pose.orientation }, orientation);
  assert.deepEqual([...message.pose.covariance], covariance);
}
function checkTf(message, row) {
  assert.equal(message.transforms.length, 1);
  const [t] = message.transforms;
  assert.equal(t.child_frame_id, row.target);
  const { x, y, z } = t.transform.translation;
  assert.deepEqual([x, y, z], row.p);
}
// messages: [topic, ns, decoded] in the order of the bag
function checkAll(messages) {
  assert.ok(messages.every(([, ns], i) => i === 0 || ns >= messages[i - 1][1]), "in the order of time");
  const of = (topic) => messages.filter(([name]) => name === topic);
  let count = 0;
  for (const name of ["ball_1", "lime"]) {
    const expected = expectedOf(rows, name);
    const poses = of(`/huetrack/${name}/pose`);
    assert.equal(poses.length, expected.length);
    poses.forEach(([, ns, message], i) => {
      assert.equal(ns, expected[i].ns);
      checkPose(message, expected[i]);
    });
    const tf = of("/tf").filter(([, , message]) => message.transforms[0].child_frame_id === name);
    assert.equal(tf.length, expected.length);
    tf.forEach(([, ns, message], i) => {
      assert.equal(ns, expected[i].ns);
      checkTf(message, expected[i]);
    });
    count += 2 * expected.length;
  }
  assert.equal(messages.length, count);
  return count;
}

// ---- rosbag2: sql.js is the database, Foxglove's reader has the rest.
async function readRosbag2(bag) {
  const metadata = yaml.load(readFileSync(join(bag, "metadata.yaml"), "utf8")).rosbag2_bagfile_information;
  assert.equal(metadata.storage_identifier, "sqlite3");
  const sql = await initSqlJs();
  const database = new sql.Database(readFileSync(join(bag, metadata.relative_file_paths[0])));
  const select = (query) => {
    const [result] = database.exec(query, undefined, { useBigInt: true });
    return result.values.map((values) => Object.fromEntries(result.columns.map((name, i) => [name, values[i]])));
  };
  const topics = select("SELECT * FROM topics").map((t) => ({ id: t.id, name: t.name, type: t.type, serializationFormat: t.serialization_format, offeredQosProfiles: [] }));
  const messages = select("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp");
  const reader = new Rosbag2([{
    open: async () => {},
    close: async () => {},
    readTopics: async () => topics,
    async *readMessages() {
      for (const m of messages) yield { topic: topics.find((t) => t.id === m.topic_id), timestamp: stampOf(m.timestamp), data: m.data };
    },
  }]);
  await reader.open();
  const decoded = [];
  for await (const m of reader.readMessages())
    decoded.push([m.topic.name, BigInt(m.timestamp.sec) * 1000000000n + BigInt(m.timestamp.nsec), m.value]);
  assert.equal(metadata.message_count, decoded.length);
  for (const { topic_metadata: topic, message_count: count } of metadata.topics_with_message_count) {
    assert.equal(count, decoded.filter(([name]) => name === topic.name).length);
    assert.equal(topic.serialization_format, "cdr");
  }
  assert.equal(BigInt(metadata.starting_time.nanoseconds_since_epoch), decoded[0][1]);
  assert.equal(BigInt(metadata.duration.nanoseconds), decoded.at(-1)[1] - decoded[0][1]);
  return decoded;
}

// ---- MCAP: by its index, and from end to end; decoded by the definitions that the file itself has.
async function readMcap(path) {
  const bytes = readFileSync(path);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const readers = new Map();
  for (const schema of reader.schemasById.values()) {
    assert.equal(schema.encoding, "ros2msg");
    readers.set(schema.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
  }
  const decoded = [];
  for await (const m of reader.readMessages()) {
    const channel = reader.channelsById.get(m.channelId);
    assert.equal(channel.messageEncoding, "cdr");
    decoded.push([channel.topic, m.logTime, readers.get(channel.schemaId).readMessage(m.data)]);
  }
  assert.equal(reader.header.profile, "ros2");
  assert.equal(Number(reader.statistics.messageCount), decoded.length);
  assert.equal(reader.statistics.chunkCount, reader.chunkIndexes.length);
  // From the beginning on, every checksum looked at.
  const stream = new McapStreamReader({ validateCrcs: true });
  stream.append(bytes);
  let messages = 0;
  for (let record; (record = stream.nextRecord()); ) if (record.type === "Message") messages++;
  assert.ok(stream.done());
  assert.equal(messages, decoded.length);
  return { decoded, chunks: reader.chunkIndexes.length };
}

let code = 1;
try {
  exported(file("tracks.csv"), "--out", file("bag"));
  exported(file("tracks.csv"), "--out", file("bag.mcap"));
  const inBag = await readRosbag2(file("bag"));
  console.log(`rosbag2: ${checkAll(inBag)} messages are those of the CSV`);
  const { decoded, chunks } = await readMcap(file("bag.mcap"));
  assert.ok(chunks > 1, `${chunks} chunks`);
  console.log(`MCAP: ${checkAll(decoded)} messages in ${chunks} chunks are those of the CSV`);

  // A tracked camera has its orientation and its whole covariance; a frame and an offset of the user's.
  const upper = Array.from({ length: 21 }, (_, i) => (i + 1) * 1e-6);
  const names = [];
  for (let i = 1; i <= 6; i++) for (let j = i; j <= 6; j++) names.push(`c${i}${j}`);
  writeFileSync(file("camera.csv"), `camera,t,x,y,z,qx,qy,qz,qw,${names.join(",")},state,features_in_view,features_matched,confidence\n` +
    `cam0,0.5,1,2,3,0.5,-0.5,0.5,-0.5,${upper.join(",")},tracking,10,9,0.9\n`);
  exported(file("camera.csv"), "--out", file("camera.mcap"), "--frame", "studio", "--clock-offset", "1700000000");
  const camera = (await readMcap(file("camera.mcap"))).decoded.find(([topic]) => topic === "/huetrack/camera/cam0/pose");
  const whole = Array(36).fill(0);
  let k = 0;
  for (let i = 0; i < 6; i++) for (let j = i; j < 6; j++) whole[6 * i + j] = whole[6 * j + i] = upper[k++];
  checkPose(camera[2], { ns: base + 500000000n, p: [1, 2, 3] }, "studio", { x: 0.5, y: -0.5, z: 0.5, w: -0.5 }, whole);

  // A recording's pictures: the bytes that lie in its films, by ffmpeg, and its rig's lenses; beside a track of the same clock, in
  // the order of time.
  const cameras = ["cam0", "cam1"];
  const recorded = yaml.load(readFileSync(join(options.recording, "rig.yaml"), "utf8")).cameras;
  const filmed = Object.fromEntries(cameras.map((name) => {
    const { status, stdout } = spawnSync("ffmpeg", ["-v", "error", "-i", join(options.recording, `${name}.mkv`), "-c", "copy", "-f", "image2pipe", "-"], { maxBuffer: 1 << 28 });
    return [name, status === 0 ? stdout : null];
  }));
  writeFileSync(file("demo.csv"), ["target,t,x,y,z,vx,vy,vz,cxx,cxy,cxz,cyy,cyz,czz,state,views,confidence",
    ...[0.05, 1.05, 2.05].map((t) => `lime,${t},1,2,3,0,0,0,1e-6,0,0,1e-6,0,1e-6,tracking,2,0.9`), ""].join("\n"));
  // Where the cameras stand: a rotation and a translation, from the rig's inverse.
  function checkPlaces([topic, , message], frame = "world", moving = []) {
    assert.equal(topic, "/tf_static");
    assert.deepEqual(message.transforms.map((t) => t.child_frame_id), cameras.filter((name) => !moving.includes(name)));
    for (const t of message.transforms) {
      assert.equal(t.header.frame_id, frame);
      const { rotation: r, translation } = recorded[t.child_frame_id].cam_from_world;
      const { x, y, z } = t.transform.translation;
      // The camera's centre is its own origin.
      r.forEach((row, i) => assert.ok(Math.abs(row[0] * x + row[1] * y + row[2] * z + translation[i]) < 1e-6));
      // Each axis of the camera, turned into the world by the quaternion, is a row of the rig's rotation.
      const { x: a, y: b, z: c, w } = t.transform.rotation;
      const turned = [
        [1 - 2 * (b * b + c * c), 2 * (a * b + c * w), 2 * (a * c - b * w)],
        [2 * (a * b - c * w), 1 - 2 * (a * a + c * c), 2 * (b * c + a * w)],
        [2 * (a * c + b * w), 2 * (b * c - a * w), 1 - 2 * (a * a + b * b)],
      ];
      turned.forEach((axis, i) => axis.forEach((v, j) => assert.ok(Math.abs(v - r[i][j]) < 1e-6)));
    }
  }
  function checkPictures(messages, offset, others) {
    checkPlaces(messages[0]);
    others += 1;
    assert.ok(messages.every(([, ns], i) => i === 0 || ns >= messages[i - 1][1]), "in the order of time");
    let count = 0;
    for (const name of cameras) {
      const images = messages.filter(([topic]) => topic === `/huetrack/${name}/image/compressed`);
      const infos = messages.filter(([topic]) => topic === `/huetrack/${name}/camera_info`);
      assert.equal(images.length, 150);
      assert.equal(infos.length, 150);
      images.forEach(([, ns, image], i) => {
        const expected = offset + BigInt(Math.round((i / 30) * 1e9));
        assert.ok(ns - expected <= 1n && expected - ns <= 1n, `${ns}, not ${expected}`);
        assert.deepEqual({ sec: image.header.stamp.sec, nsec: image.header.stamp.nsec ?? image.header.stamp.nanosec }, stampOf(ns));
        assert.equal(image.header.frame_id, name);
        assert.equal(image.format, "jpeg");
        assert.deepEqual([...image.data.subarray(0, 2)], [0xff, 0xd8]);
        assert.equal(infos[i][1], ns);
      });
      if (filmed[name]) assert.ok(Buffer.concat(images.map(([, , image]) => image.data)).equals(filmed[name]), `${name}: the film's own bytes`);
      const { fx, fy, cx, cy } = recorded[name].intrinsics;
      const [, , info] = infos[75];
      assert.equal(info.header.frame_id, name);
      assert.deepEqual([info.width, info.height], recorded[name].image_size);
      assert.equal(info.distortion_model, "plumb_bob");
      assert.deepEqual([...info.d], recorded[name].distortion);
      assert.deepEqual([...info.k], [fx, 0, cx, 0, fy, cy, 0, 0, 1]);
      assert.deepEqual([...info.p], [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]);
      assert.equal(info.roi.do_rectify, false);
      count += images.length + infos.length;
    }
    assert.equal(messages.length, count + others);
    return count;
  }
  assert.match(exported(file("demo.csv"), "--pictures", options.recording, "--out", file("demo.mcap")), /607 messages on 7 topics/);
  const demo = await readMcap(file("demo.mcap"));
  assert.ok(demo.chunks > 3, `${demo.chunks} chunks`);
  console.log(`MCAP: ${checkPictures(demo.decoded, 0n, 6)} pictures and camera infos are the recording's`);
  exported("--pictures", options.recording, "--out", file("demo_bag"), "--clock-offset", "1700000000");
  console.log(`rosbag2: ${checkPictures(await readRosbag2(file("demo_bag")), base, 0)} pictures and camera infos are the recording's`);

  // The cameras' videos instead of a recording, before the track.
  const videos = ["cam0", "cam1"].map((name) => `${name}=${join(options.recording, `${name}.mkv`)}`);
  const rigFile = join(options.recording, "rig.yaml");
  assert.match(exported("--pictures", ...videos, file("demo.csv"), "--rig", rigFile, "--out", file("videos.mcap")), /607 messages on 7 topics/);

  // A track with a rig alone; a camera that moves is not said to stand.
  exported(file("camera.csv"), "--out", file("moving.mcap"), "--frame", "studio", "--rig", join(options.recording, "rig.yaml"));
  const moving = (await readMcap(file("moving.mcap"))).decoded;
  assert.equal(moving.length, 3);
  checkPlaces(moving[0], "studio", ["cam0"]);
  assert.deepEqual({ ...moving[0][2].transforms[0].header.stamp }, { ...moving[1][2].header?.stamp ?? moving[1][2].transforms[0].header.stamp });
  // Who begins to listen later gets it, too: as rosbag2 writes such topics.
  const latched = yaml.load(readFileSync(join(file("demo_bag"), "metadata.yaml"), "utf8")).rosbag2_bagfile_information
    .topics_with_message_count.filter(({ topic_metadata: topic }) => topic.offered_qos_profiles !== "");
  assert.deepEqual(latched.map(({ topic_metadata: topic }) => topic.name), ["/tf_static"]);
  const [qos] = yaml.load(latched[0].topic_metadata.offered_qos_profiles);
  assert.deepEqual([qos.history, qos.depth, qos.reliability, qos.durability], [1, 1, 1, 1]);
  assert.equal(qos.deadline.sec, 9223372036);

  // What may not be: one sentence each, and nothing lost.
  const refused = (message, ...args) => {
    const { status, stderr } = huetrack("export", ...args);
    assert.equal(status, 1);
    assert.match(stderr, message);
    assert.equal(stderr.trim().split("\n").length, 1, stderr);
  };
  refused(/bag exists; a rosbag2 is a new folder/, file("tracks.csv"), "--out", file("bag"));
  refused(/a rosbag2 is a folder/, file("tracks.csv"), "--out", file("x.db3"));
  refused(/watch --format tum` writes TUM/, file("tracks.csv"), "--out", file("x.tum"));
  const again = huetrack("export", file("tracks.csv"), "--out", file("bag.mcap"));
  assert.equal(again.status, 0, again.stderr);
  assert.match(again.stderr, /bag\.mcap: the previous file is replaced/);
  assert.doesNotMatch(huetrack("export", file("tracks.csv"), "--out", file("new.mcap")).stderr, /replaced/);
  refused(/camera\.csv exists, and is no MCAP|camera\.csv.*MCAP|a rosbag2 is a folder/, file("tracks.csv"), "--out", file("camera.csv"));
  refused(/give a track CSV, or --pictures/, "--out", file("y.mcap"));
  refused(/./, "--pictures", file("nowhere"), "--out", file("y.mcap"));
  refused(/none that ROS 2 can say/, "--pictures", options.recording, "--out", file("y.mcap"), "--clock-offset", "-10");
  refused(/none that ROS 2 can say/, "--pictures", options.recording, "--out", file("y_bag"), "--clock-offset", "-2.5");
  for (const name of ["y.mcap", "y_bag"]) assert.equal(existsSync(file(name)), false);
  refused(/none that ROS 2 can say/, file("camera.csv"), "--out", file("y.mcap"), "--clock-offset", "-10");
  writeFileSync(file("z.mcap"), "notes");
  refused(/z\.mcap/, file("tracks.csv"), "--out", file("z.mcap"));
  assert.equal(readFileSync(file("z.mcap"), "utf8"), "notes");
  writeFileSync(file("lost.csv"), "target,t,x,y,z,cxx,cxy,cxz,cyy,cyz,czz,state\na,1,nan,nan,nan,nan,nan,nan,nan,nan,nan,lost\n");
  refused(/no row has a position/, file("lost.csv"), "--out", file("lost"));
  assert.equal(existsSync(file("lost")), false);
  code = 0;
  console.log("passed");
} catch (error) {
  console.error(error);
} finally {
  if (code === 0) rmSync(folder, { recursive: true, force: true });
}
process.exit(code);
