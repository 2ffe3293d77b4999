// V4l2Source on a misbehaving driver, played by this program's own ioctl() on a plain file.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstdarg>
#include <cstring>
#include <deque>
#include <fstream>
#include <map>
#include <mutex>
#include <thread>

#include "capture/clips.h"
#include "capture/cropped_source.h"
#include "capture/v4l2_source.h"

namespace huetrack::capture {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::HasSubstr;

constexpr std::uint32_t width = 16, height = 16, page = 4096;

// A camera with YUYV at 5 and MJPEG at 30 frames/s, and three controls.
class Driver {
 public:
  bool is_mine(int fd) {
    struct stat status {};
    return ::fstat(fd, &status) == 0 && status.st_ino == inode && inode != 0;
  }
  // 0, or errno.
  int answer(unsigned long request, void* argument) {
    std::unique_lock lock(mutex);
    const auto asks_camera = [&] {
      ++asked;
      released.wait(lock, [&] { return !is_locked_up; });
      return is_dead ? ETIMEDOUT : 0;
    };
    switch (request) {
      case VIDIOC_QUERYCAP: {
        auto& c = *static_cast<v4l2_capability*>(argument);
        std::strcpy(reinterpret_cast<char*>(c.driver), "fake");
        c.capabilities = V4L2_CAP_DEVICE_CAPS;
        c.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
      }
      case VIDIOC_ENUM_FMT: {
        auto& f = *static_cast<v4l2_fmtdesc*>(argument);
        if (f.index > 1) return EINVAL;
        f.pixelformat = f.index == 0 ? V4L2_PIX_FMT_YUYV : V4L2_PIX_FMT_MJPEG;
        return 0;
      }
      case VIDIOC_ENUM_FRAMESIZES: {
        auto& s = *static_cast<v4l2_frmsizeenum*>(argument);
        if (s.index > 0) return EINVAL;
        s.type = V4L2_FRMSIZE_TYPE_DISCRETE;
        s.discrete = {width, height};
        return 0;
      }
      case VIDIOC_ENUM_FRAMEINTERVALS: {
        auto& i = *static_cast<v4l2_frmivalenum*>(argument);
        if (i.index > 0) return EINVAL;
        i.type = V4L2_FRMIVAL_TYPE_DISCRETE;
        i.discrete = {1, i.pixel_format == V4L2_PIX_FMT_YUYV ? 5u : 30u};
        return 0;
      }
      case VIDIOC_G_FMT:
        return 0;
      case VIDIOC_S_FMT:
        if (is_busy) return EBUSY;
        fourcc = static_cast<v4l2_format*>(argument)->fmt.pix.pixelformat;
        return 0;
      case VIDIOC_G_PARM: {
        auto& p = static_cast<v4l2_streamparm*>(argument)->parm.capture;
        p.capability = V4L2_CAP_TIMEPERFRAME;
        p.timeperframe = {1, fourcc == V4L2_PIX_FMT_YUYV ? 5u : 30u};
        return 0;
      }
      case VIDIOC_S_PARM:
        return 0;
      case VIDIOC_REQBUFS:
        queue.clear();
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& b = *static_cast<v4l2_buffer*>(argument);
        b.length = page;
        b.m.offset = b.index * page;
        return 0;
      }
      case VIDIOC_QBUF:
        queue.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF: {
        lock.unlock();
        std::this_thread::sleep_for(2ms);
        lock.lock();
        if (dequeue_error != 0) return dequeue_error;
        if (queue.empty()) return EAGAIN;
        auto& b = *static_cast<v4l2_buffer*>(argument);
        b.index = queue.front();
        queue.pop_front();
        b.bytesused = width * height * 2;
        b.sequence = sequence++;
        b.flags = is_damaging ? V4L2_BUF_FLAG_ERROR : 0;
        return 0;
      }
      case VIDIOC_STREAMON:
        return streamon_error;
      case VIDIOC_STREAMOFF:
        queue.clear();
        asks_camera();
        return 0;
      case VIDIOC_QUERY_EXT_CTRL: {
        auto& q = *static_cast<v4l2_query_ext_ctrl*>(argument);
        const std::uint32_t id = q.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
        const auto found = q.id == id ? controls.find(id) : controls.upper_bound(id);
        if (found == controls.end()) return EINVAL;
        q.id = found->first;
        q.type = V4L2_CTRL_TYPE_INTEGER;
        q.maximum = 255;
        std::strcpy(q.name, q.id == V4L2_CID_BRIGHTNESS ? "Brightness"
                            : q.id == V4L2_CID_CONTRAST ? "Contrast"
                                                        : "Hue");
        return 0;
      }
      case VIDIOC_G_EXT_CTRLS: {
        if (const int e = asks_camera()) return e;
        auto& c = *static_cast<v4l2_ext_controls*>(argument)->controls;
        c.value = controls.at(c.id);
        return 0;
      }
      case VIDIOC_S_EXT_CTRLS: {
        if (const int e = asks_camera()) return e;
        const auto& c = *static_cast<v4l2_ext_controls*>(argument)->controls;
        controls.at(c.id) = c.value;
        ++set;
        return 0;
      }
      default:
        return ENOTTY;
    }
  }

  std::mutex mutex;
  std::condition_variable released;
  ino_t inode = 0;
  bool is_locked_up = false, is_dead = false, is_busy = false, is_damaging = false;
  int dequeue_error = 0, streamon_error = 0;
  int asked = 0, set = 0;
  std::uint32_t fourcc = 0, sequence = 0;
  std::deque<std::uint32_t> queue;
  std::map<std::uint32_t, int> controls{{V4L2_CID_BRIGHTNESS, 10}, {V4L2_CID_CONTRAST, 20}, {V4L2_CID_HUE, 30}};
};

// Never destroyed: a thread may still ask it.
std::atomic<Driver*> driver = nullptr;

class V4l2Faults : public testing::Test {
 protected:
  V4l2Faults() {
    std::ofstream(folder / "camera", std::ios::binary) << std::string(32 * page, '\x80');
    struct stat status {};
    EXPECT_EQ(::stat((folder / "camera").c_str(), &status), 0);
    auto fresh = new Driver;
    fresh->inode = status.st_ino;
    driver = fresh;
    options.name = "left";
    options.device = folder / "camera";
    options.width = width;
    options.height = height;
    options.format = CaptureFormat::yuyv;
    options.retry = 10ms;
  }
  template <typename F>
  static void tell(F&& change) {
    Driver& d = *driver;
    const std::scoped_lock lock(d.mutex);
    change(d);
    d.released.notify_all();
  }
  static int value(std::uint32_t id) {
    Driver& d = *driver;
    const std::scoped_lock lock(d.mutex);
    return d.controls.at(id);
  }
  static int of(int Driver::*count) {
    Driver& d = *driver;
    const std::scoped_lock lock(d.mutex);
    return d.*count;
  }
  // Reads until that is so.
  template <typename F>
  void read_until(V4l2Source& source, F&& is_so) {
    std::stop_source stop;
    const std::jthread reader([&] {
      while (source.next(stop.get_token()))
        ;
    });
    const auto give_up = std::chrono::steady_clock::now() + 60s;
    while (!is_so() && std::chrono::steady_clock::now() < give_up) {
      for (auto& event : source.take_events()) messages.push_back(std::move(event.message));
      std::this_thread::sleep_for(5ms);
    }
    EXPECT_TRUE(is_so()) << source.health().message;
    stop.request_stop();
  }
  int count_of(const std::string& text) const {
    return int(std::ranges::count_if(messages, [&](const auto& m) { return m.find(text) != std::string::npos; }));
  }

  TemporaryFolder folder;
  V4l2SourceOptions options;
  std::vector<std::string> messages;
};

TEST_F(V4l2Faults, HealthyCameraDelivers) {
  V4l2Source source(options);
  read_until(source, [&] { return source.health().frames > 20; });
  EXPECT_EQ(source.health().state, CaptureState::delivering);
  EXPECT_EQ(source.health().dropped, 0u);
}

// A side-by-side stereo webcam: one device, opened once, and two cameras with a part of its picture each.
TEST_F(V4l2Faults, CamerasWithACropShareADevice) {
  {
    std::fstream file(folder / "camera", std::ios::binary | std::ios::in | std::ios::out);
    for (int buffer = 0; buffer < 32; ++buffer)
      for (std::uint32_t v = 0; v < height; ++v)
        for (std::uint32_t u = 0; u < width; ++u) {
          const std::array<char, 2> pixel{char(v * width + u), '\x80'};
          file.seekp(buffer * std::streamoff(page) + 2 * (v * width + u)).write(pixel.data(), 2);
        }
  }
  const std::map<int, Crop> crops{{0, {0, 0, 8, 16}}, {1, {8, 2, 8, 14}}};
  std::vector<CameraRequest> requests;
  for (const auto& [camera, crop] : crops) {
    CameraRequest& request = requests.emplace_back(CameraRequest{options, crop});
    request.camera = camera;
    request.timing = {.latency = (camera + 1) * 10ms, .readout = 5ms};
  }
  ASSERT_EQ(problem_of(requests), "");
  const std::vector<SharedDevice> devices = by_device(requests);
  ASSERT_EQ(devices.size(), 1u);
  CroppedSource source(std::make_unique<V4l2Source>(devices.front().options), devices.front().parts);
  std::optional<Frame> before;
  for (int k = 0; k < 40; ++k) {
    const auto frame = source.next({});
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->camera, k % 2);
    const Crop& crop = crops.at(frame->camera);
    ASSERT_EQ(frame->pixels.width, crop.width);
    ASSERT_EQ(frame->pixels.height, crop.height);
    for (int v = 0; v < crop.height; ++v)
      for (int u = 0; u < crop.width; ++u)
        ASSERT_EQ(yuv_at(frame->pixels, u, v).y, (v + crop.v) * int(width) + u + crop.u) << u << ' ' << v;
    if (frame->camera == 1) {
      EXPECT_EQ(frame->sequence, before->sequence);
      EXPECT_EQ(before->captured_at - frame->captured_at, 10ms) << "each has its own latency";
    }
    before = frame;
  }
}

// Of a camera host: what travels on is the camera's own bytes, and nothing of them is looked at but that they begin as
// a JPEG does.
TEST_F(V4l2Faults, ForwardedJpegsAreNotDecoded) {
  options.format = CaptureFormat::mjpeg;
  options.fps = 30;
  options.decodes = false;
  V4l2Source source(options);
  const auto first = source.next({});
  ASSERT_TRUE(first);
  EXPECT_EQ(first->status, FrameStatus::corrupted);
  {
    std::fstream file(folder / "camera", std::ios::binary | std::ios::in | std::ios::out);
    for (int buffer = 0; buffer < 32; ++buffer) file.seekp(buffer * std::streamoff(page)).write("\xff\xd8", 2);
  }
  for (int i = 0; i < 20; ++i) {
    const auto frame = source.next({});
    ASSERT_TRUE(frame);
    if (frame->status != FrameStatus::ok) continue;  // dequeued before
    ASSERT_TRUE(frame->encoded);
    EXPECT_EQ(frame->encoded->size(), std::size_t(width * height * 2));
    EXPECT_EQ(frame->encoded->front(), 0xff);
    EXPECT_EQ(frame->pixels.width, int(width));
    EXPECT_EQ(frame->pixels.height, int(height));
    EXPECT_EQ(frame->pixels.planes[0].data, nullptr);
    return;
  }
  ADD_FAILURE() << "no frame that begins as a JPEG";
}

TEST_F(V4l2Faults, LockedUpCameraBlocksNothing) {
  options.controls = {{"brightness", 100}, {"contrast", 100}, {"hue", 100}};
  options.restore_controls = true;
  options.first_patience = 50ms;
  tell([](Driver& d) { d.is_locked_up = true; });
  {
    V4l2Source source(options);  // comes back though no answer has come
    read_until(source, [&] { return source.health().state == CaptureState::absent; });  // nor does a stop wait for one
    EXPECT_THAT(source.health().message, HasSubstr("does not answer, since it was to be opened"));
    EXPECT_LT(std::chrono::steady_clock::now() - source.health().last_progress, 5s) << "waiting on purpose is progress";
  }
  EXPECT_THAT(abandoned_cameras(), Contains("left"));
  tell([](Driver& d) { d.is_locked_up = false, d.is_dead = true; });
}

TEST_F(V4l2Faults, UnresponsiveCameraIsNotAskedAgain) {
  tell([](Driver& d) { d.is_dead = true; });
  V4l2Device device(options.device);
  const std::vector<ControlSetting> settings{{"brightness", 100}, {"contrast", 100}, {"hue", 100}};
  const auto results = device.set_controls(settings);
  ASSERT_EQ(results.size(), 3u);
  for (const auto& result : results) {
    EXPECT_TRUE(result.is_unanswered);
    EXPECT_THAT(result.problem, HasSubstr("does not answer: Connection timed out"));
  }
  EXPECT_EQ(of(&Driver::asked), 1);
  options.controls = settings;
  V4l2Source source(options);
  EXPECT_EQ(source.health().state, CaptureState::absent);
  EXPECT_THAT(source.health().message, HasSubstr("does not answer: Connection timed out"));
  tell([](Driver& d) { d.is_dead = false; });
  read_until(source, [&] { return source.health().state == CaptureState::delivering; });
  EXPECT_EQ(value(V4L2_CID_HUE), 100) << "and it is taken back by itself";
}

TEST_F(V4l2Faults, ControlsOfABusyCameraAreUnchanged) {
  options.controls = {{"brightness", 200}};
  options.restore_controls = true;
  tell([](Driver& d) { d.is_busy = true; });
  {
    V4l2Source source(options);
    EXPECT_EQ(source.health().state, CaptureState::absent);
    EXPECT_THAT(source.health().message, HasSubstr("another program uses it"));
    EXPECT_EQ(value(V4L2_CID_BRIGHTNESS), 10);
    EXPECT_EQ(of(&Driver::set), 0);
    tell([](Driver& d) { d.is_busy = false, d.streamon_error = ENOSPC; });
    read_until(source, [&] { return source.health().message.find("USB bandwidth") != std::string::npos; });
    tell([](Driver& d) { d.is_busy = true; });
    read_until(source, [&] { return source.health().message.find("another program") != std::string::npos; });
    EXPECT_EQ(value(V4L2_CID_BRIGHTNESS), 10) << "set, and put back when it did not start";
    EXPECT_GT(of(&Driver::set), 0);
    tell([](Driver& d) { d.is_busy = false, d.streamon_error = 0; });
    read_until(source, [&] { return source.health().state == CaptureState::delivering; });
    EXPECT_EQ(value(V4L2_CID_BRIGHTNESS), 200);
  }
  EXPECT_EQ(value(V4L2_CID_BRIGHTNESS), 10) << "restored at the end";
}

TEST_F(V4l2Faults, DamagedFramesAloneAreNoDelivery) {
  V4l2Source source(options);
  read_until(source, [&] { return source.health().frames > 3; });
  tell([](Driver& d) { d.is_damaging = true; });
  read_until(source, [&] { return source.health().restarts > 1; });
  auto health = source.health();
  EXPECT_EQ(health.state, CaptureState::stalled);
  EXPECT_THAT(health.message, HasSubstr("only damaged frames for "));
  EXPECT_THAT(health.warning, HasSubstr("% of its frames are damaged"));
  EXPECT_EQ(count_of("only damaged frames"), 1);
  tell([](Driver& d) { d.is_damaging = false; });
  read_until(source,
             [&] { return source.health().state == CaptureState::delivering && source.health().warning.empty(); });
  for (auto& event : source.take_events()) messages.push_back(std::move(event.message));
  EXPECT_EQ(count_of("delivers again"), 1);
}

TEST_F(V4l2Faults, SilentDriverIsReportedOnceThroughReopening) {
  V4l2Source source(options);
  read_until(source, [&] { return source.health().frames > 3; });
  tell([](Driver& d) { d.dequeue_error = EIO; });
  read_until(source, [&] { return source.health().restarts > 12; });
  EXPECT_EQ(source.health().state, CaptureState::stalled);
  EXPECT_EQ(count_of("its stream is restarted"), 1) << testing::PrintToString(messages);
  tell([](Driver& d) { d.dequeue_error = 0; });
  read_until(source, [&] { return source.health().state == CaptureState::delivering; });
  tell([](Driver& d) { d.dequeue_error = EIO; });
  read_until(source, [&] { return source.health().restarts > 16; });
  EXPECT_EQ(count_of("its stream is restarted"), 2) << "it had delivered in between";
}

TEST_F(V4l2Faults, ChoosesTheFormatThatReachesTheRate) {
  options.format.reset();
  const auto agreed = [&](double fps) {
    options.fps = fps;
    const V4l2Source source(options);
    return source.health().stream->format;
  };
  EXPECT_EQ(agreed(5), CaptureFormat::yuyv);
  EXPECT_EQ(agreed(15), CaptureFormat::mjpeg);
  EXPECT_EQ(agreed(60), CaptureFormat::mjpeg) << "the nearest to it";
  EXPECT_EQ(agreed(0), CaptureFormat::mjpeg);
}

TEST(PreferredRate, FirstThatReachesItElseTheFastest) {
  const auto of = [](const std::vector<double>& rates, double asked) { return preferred_rate(rates, asked); };
  EXPECT_EQ(of({}, 30), std::nullopt);
  EXPECT_EQ(of({30, 30}, 30), 0u);
  EXPECT_EQ(of({29.97, 60}, 30), 0u);
  EXPECT_EQ(of({5, 30, 60}, 30), 1u);
  EXPECT_EQ(of({5, 30, 15}, 60), 1u);
  EXPECT_EQ(of({30, 30}, 0), 0u) << "as good: the preferred one";
  EXPECT_EQ(of({30, 30.003}, 0), 0u);
  EXPECT_EQ(of({5, 30}, 0), 1u);
  EXPECT_EQ(of({0, 30}, 0), 0u) << "the driver does not say";
  EXPECT_EQ(of({5, 0, 30}, 0), 2u);
}

TEST(V4l2SourceOptions, RefusesAnImpossibleRate) {
  V4l2SourceOptions options;
  options.device = "/dev/video0";
  options.width = options.height = 16;
  options.fps = 1e9;
  EXPECT_THAT(options.problems(), testing::ElementsAre(HasSubstr("must be 0 to 10000")));
}

TEST(DamageWatch, HasHysteresisFromTenToFivePercent) {
  DamageWatch watch;
  for (int i = 0; i < 1000; ++i) watch.add(i % 50 == 0);
  EXPECT_FALSE(watch.is_high());
  for (int i = 0; i < 1000; ++i) watch.add(i % 5 == 0);
  EXPECT_TRUE(watch.is_high());
  EXPECT_NEAR(watch.share(), 0.2, 0.05);
  for (int i = 0; i < 1000; ++i) watch.add(i % 14 == 0);
  EXPECT_TRUE(watch.is_high()) << "7 %";
  for (int i = 0; i < 1000; ++i) watch.add(false);
  EXPECT_FALSE(watch.is_high());
}

}  // namespace
}  // namespace huetrack::capture

// Takes the place of the C library's.
extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  huetrack::capture::Driver* const driver = huetrack::capture::driver;
  if (driver == nullptr || !driver->is_mine(fd)) return int(::syscall(SYS_ioctl, fd, request, argument));
  const int error = driver->answer(request, argument);
  if (error == 0) return 0;
  errno = error;
  return -1;
}
