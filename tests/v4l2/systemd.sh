#!/bin/bash
# Installs the package on a bare Debian 12, boots that with a real systemd and udev in the VM of tests/v4l2/run.sh, plugs in two
# USB cameras (emulated, through uvcvideo), edits the one file that service/daemon/live.md names, and uses the service: start, reload,
# kill -9, unplug, stop. Not part of CI: it takes some five minutes and the network.
#   sudo tests/v4l2/systemd.sh DEB [ROOT]
# DEB: huetrack_*.deb of cpack. ROOT: a folder for that Debian (default: one that is removed afterwards); kept and used again
# when given. Needs debootstrap, ffmpeg, and what tests/v4l2/run.sh needs. Exit status 0: every line says ok.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
demo=$(cd "$here/../../configs/demo/recording" && pwd)
vm=$(realpath "${V4L2VM_DIR:-$here/../../../shared/tools/v4l2vm}")
deb=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
root=$(realpath -m "${2:-$work/root}")

if [ ! -x "$root/lib/systemd/systemd" ]; then
  debootstrap --variant=minbase --include=systemd,systemd-sysv,udev,procps,curl bookworm "$root" http://deb.debian.org/debian
fi
if ! dpkg-deb --fsys-tarfile "$deb" | tar -xO ./usr/bin/huetrackd | cmp -s - "$root/usr/bin/huetrackd"; then
  cp /etc/resolv.conf /etc/hosts "$root/etc/"
  cp "$deb" "$root/tmp/huetrack.deb"
  chroot "$root" sh -e <<'IN'
export DEBIAN_FRONTEND=noninteractive
apt-get update -qq
apt-get purge -y -qq huetrack >/dev/null 2>&1 || true
apt-get install -y -qq --no-install-recommends /tmp/huetrack.deb >/dev/null
IN
fi

mkdir -p "$root/opt/cameras"
for camera in cam0 cam1; do
  ffmpeg -v error -y -i "$demo/$camera.mkv" -pix_fmt yuyv422 -f rawvideo "$root/opt/cameras/$camera.yuyv"
done
gcc-12 -O2 -w -pthread -static -o "$root/opt/cameras/uvccam" "$vm/tools/uvccam.c"
cp "$demo/rig.yaml" "$root/opt/cameras/"

# What a user does, as root, once it has booted.
cat >"$root/opt/cameras/use" <<'IN'
#!/bin/bash
# The result of the last command, in a line; at the end, how many were not as they should be.
bad=0
says() { if [ "$2" = 0 ]; then echo "ok      $1"; else echo "NOT OK  $1"; bad=$((bad + 1)); fi; }
within() { for ((i = 0; i < $1 * 5; i++)); do "${@:2}" && return 0; sleep 0.2; done; return 1; }
state() { [ "$(systemctl show -p ActiveState --value huetrackd)" = "$1" ]; }
log() { journalctl -q -u huetrackd -o cat | grep -q -- "$1"; }
tracks() { [ "$(timeout 60 huetrack watch --count 20 --format csv 2>/dev/null | grep -c ,tracking,)" -ge 10 ]; }
pid() { systemctl show -p MainPID --value huetrackd; }
cd /opt/cameras
./uvccam -w 320 -h 240 -r 15 cam0.yuyv cam1.yuyv >/out/uvccam.log 2>&1 & cameras=$!
has_cameras() { [ "$(ls -d /dev/v4l/by-path/*index0 2>/dev/null | wc -l)" = 2 ]; }
within 60 has_cameras
ls -l /dev/v4l/by-path | tee -a /out/journal
mapfile -t paths < <(ls -d /dev/v4l/by-path/*index0)
[ ${#paths[@]} = 2 ]; says "udev gives two cameras names by their ports" $?
systemctl is-enabled -q huetrackd; [ $? != 0 ]; says "installing it does not enable it" $?
state active; [ $? != 0 ]; says "nor start it" $?

cp rig.yaml /etc/huetrack/rig.yaml
sed -i -e 's/^  ball:$/  lime:/' -e 's/^  port: none  /  port: 9464  /' \
  -e '/^cameras:/,/^[a-z_]*:/{/^cameras:/d;/^  /d}' /etc/huetrack/huetrackd.yaml
echo "cameras: {cam0: {device: ${paths[0]}, fps: 15}, cam1: {device: ${paths[1]}, fps: 15}}" >>/etc/huetrack/huetrackd.yaml
grep -n '^cameras:\|^rig:\|^  port:\|^  lime:' /etc/huetrack/huetrackd.yaml
systemctl start huetrackd; says "systemctl start" $?
state active; says "it is ready" $?
[ "$bad" = 0 ] || journalctl -q -u huetrackd -o cat | head -40
systemctl --no-pager status huetrackd | sed -n 1,16p
systemctl show -p StatusText --value huetrackd | grep -q 'cam0'; says "the status text names the cameras: $(systemctl show -p StatusText --value huetrackd)" $?
tracks; says "a subscriber sees the ball tracked" $?
curl -sf http://127.0.0.1:9464/metrics | grep -q huetrack; says "metrics" $?
user=$(stat -c %U /proc/"$(pid)" 2>/dev/null || true); [ "$user" != root ]; says "it does not run as root (as $user)" $?

sed -i 's/hue_deg: \[65, 115\]/hue_deg: [60, 120]/' /etc/huetrack/huetrackd.yaml
systemctl reload huetrackd; says "systemctl reload" $?
within 10 log 'reloaded\|taken over\|takes over'; says "the log says so" $?
sed -i 's/hue_deg: \[60, 120\]/hue_deg: [60, 1200]/' /etc/huetrack/huetrackd.yaml
systemctl reload huetrackd; within 10 log 'out of range\|0..360\|refused'; says "a bad file is refused" $?
state active && tracks; says "and it goes on with the old one" $?
sed -i 's/hue_deg: \[60, 1200\]/hue_deg: [60, 120]/' /etc/huetrack/huetrackd.yaml

before=$(pid); kill -9 "$before"; sleep 1
within 40 state active; [ "$(pid)" != "$before" ] && [ "$(pid)" != 0 ]; says "killed, systemd starts it again" $?
tracks; says "and it tracks again" $?

kill "$cameras"; wait "$cameras" 2>/dev/null
within 20 log 'unplugged\|absent\|gone'; says "unplugged cameras are reported" $?
sleep 31; state active; says "without cameras it waits, past the watchdog's time" $?
./uvccam -w 320 -h 240 -r 15 cam0.yuyv cam1.yuyv >/out/uvccam.log 2>&1 & cameras=$!
within 60 tracks; says "plugged in again, it tracks" $?

start=$(date +%s%N); systemctl stop huetrackd; status=$?
took=$((($(date +%s%N) - start) / 1000000))
says "systemctl stop ($took ms)" $status
[ "$took" -lt 5000 ]; says "before systemd's patience ends, on an emulated machine" $?
[ "$(systemctl show -p Result --value huetrackd)" = success ]; says "it ended well" $?
systemctl stop systemd-udevd 2>/dev/null
journalctl -q -u huetrackd -o short-precise >>/out/journal
kill "$cameras"
systemd-analyze security huetrackd --no-pager | tail -1
echo "$bad not ok"
echo "$bad" >/out/bad
systemctl --force --force poweroff
IN
chmod +x "$root/opt/cameras/use"
cat >"$root/etc/systemd/system/use.service" <<'IN'
[Service]
Type=exec
ExecStart=/opt/cameras/use
StandardOutput=append:/out/use.log
StandardError=append:/out/use.log
[Install]
WantedBy=multi-user.target
IN
for unit in getty.target e2scrub_reap.service systemd-update-utmp.service systemd-update-utmp-runlevel.service; do
  ln -sfn /dev/null "$root/etc/systemd/system/$unit"  # no logins, and an emulated machine is slow
done
ln -sfn ../use.service "$root/etc/systemd/system/multi-user.target.wants/use.service"

# systemd is the first process of a namespace of its own: the VM has its own init.
status=0
cd /  # a folder that the guest has, too
"$vm/v4l2vm.sh" --root "$root" --uvc --timeout 900 --out "$work/out" -- /bin/sh -c '
  mount -t cgroup2 none /sys/fs/cgroup
  exec unshare --pid --fork --mount --mount-proc /lib/systemd/systemd --log-level=warning --show-status=0' || status=$?
cat "$work/out/use.log" 2>/dev/null || true
if [ "$(cat "$work/out/bad" 2>/dev/null)" != 0 ]; then
  echo "--- the journal"
  cat "$work/out/journal" 2>/dev/null || { echo "(none: the VM ended with status $status)"; tail -30 "$work/out/console.log"; }
  exit 1
fi
