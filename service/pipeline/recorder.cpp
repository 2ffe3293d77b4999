#include "pipeline/recorder.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace huetrack::pipeline {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto frame_patience = 200ms;  // capacity: wait for a frame before a camera's pre-roll is written
constexpr auto pre_roll_patience = 5s;  // capacity: wait beyond the end for a slow writing thread

}  // namespace

Recorder::Camera::Camera(const RecorderOptions& options, std::size_t cameras)
    : waiting(options.queue_frames, WhenFull::drop_oldest) {
  if (!options.pre_roll) return;
  recordings::PreRollOptions share = *options.pre_roll;
  share.most_bytes = std::max<std::size_t>(share.most_bytes / cameras, 1);
  pre_roll.emplace(share);
}

Recorder::Recorder(RecorderOptions options) : options_(std::move(options)) {
  const std::size_t count = options_.recording.cameras.size();
  if (count == 0) throw std::invalid_argument("Recorder: there is no camera");
  for (std::size_t c = 0; c < count; ++c) cameras_.push_back(std::make_unique<Camera>(options_, count));
  for (auto& camera : cameras_) camera->thread = std::jthread([this, &camera = *camera] { write(camera); });
}

Recorder::~Recorder() {
  finish();
}

void Recorder::start(const std::filesystem::path& folder, bool with_pre_roll) {
  leaves_pre_roll_out_ = !with_pre_roll;
  open(folder);
  until_.reset();
}

bool Recorder::save_pre_roll(const std::filesystem::path& folder, capture::Duration after) {
  const auto end = Clock::now() + after;
  if (is_recording()) {
    if (until_) until_ = std::max(*until_, end);
    return false;
  }
  leaves_pre_roll_out_ = false;
  open(folder);
  until_ = end;
  return true;
}

void Recorder::end_when_due() {
  if (!until_ || Clock::now() < *until_ || !is_recording()) return;
  // The pre-roll is written however short `after` is.
  const bool is_written =
      std::ranges::all_of(cameras_, [&](const auto& camera) { return camera->has_begun == opened_; });
  if (is_written || Clock::now() >= *until_ + pre_roll_patience) close();
}

bool Recorder::is_recording() const {
  return writer() != nullptr;
}

void Recorder::stop() {
  if (is_recording()) close();
}

void Recorder::offer(const capture::Frame& frame) {
  if (!has_writer_.load(std::memory_order_relaxed) && !options_.pre_roll) return;  // not needed
  cameras_[std::size_t(frame.camera)]->waiting.push(frame);
}

RecorderFigures Recorder::figures() const {
  RecorderFigures figures;
  {
    const std::scoped_lock lock(mutex_);
    figures = last_;
    if (writer_) {
      figures.cameras = writer_->figures();
      figures.failure = writer_->failure();
    }
  }
  for (const auto& camera : cameras_) {
    figures.dropped.push_back(camera->waiting.dropped() + camera->given_up);
    const capture::Duration fits{camera->fits_ns.load()};
    if (fits >= capture::Duration::zero())
      figures.pre_roll_that_fits = std::min(figures.pre_roll_that_fits.value_or(fits), fits);
    const capture::Duration held{camera->held_ns.load()};
    if (held >= capture::Duration::zero()) figures.pre_roll_held = std::min(figures.pre_roll_held.value_or(held), held);
  }
  return figures;
}

void Recorder::finish(capture::Duration patience) {
  for (const auto& camera : cameras_) camera->waiting.close();
  for (const auto end = Clock::now() + patience;
       Clock::now() < end && !std::ranges::all_of(cameras_, [](const auto& camera) { return camera->is_done.load(); });)
    std::this_thread::sleep_for(2ms);
  for (const auto& camera : cameras_)
    while (camera->waiting.pop_for(0ns)) ++camera->given_up;
  for (const auto& camera : cameras_)
    if (camera->thread.joinable()) camera->thread.join();
  if (const auto last = writer()) last->finish();
  if (is_recording()) close();
}

void Recorder::write(Camera& camera) {
  while (!camera.waiting.ended()) {
    const auto frame = camera.waiting.pop_for(frame_patience);
    const int opened = opened_;  // read before writer(): of that writer or an older one
    if (const auto to = writer()) {
      if (camera.pre_roll && camera.pre_roll->size() > 0)
        for (const capture::Frame& earlier : camera.pre_roll->take())
          if (!leaves_pre_roll_out_) to->write(earlier);
      if (camera.pre_roll) camera.held_ns = 0;
      camera.has_begun = opened;
      if (frame) to->write(*frame);
    } else if (camera.pre_roll && frame) {
      camera.pre_roll->push(*frame);
      camera.held_ns = camera.pre_roll->length().count();
      if (const auto fits = camera.pre_roll->cut_to()) camera.fits_ns = fits->count();
    }
  }
  camera.is_done = true;
}

std::shared_ptr<recordings::RecordingWriter> Recorder::writer() const {
  const std::scoped_lock lock(mutex_);
  return writer_;
}

void Recorder::open(const std::filesystem::path& folder) {
  recordings::RecordingOptions recording = options_.recording;
  recording.folder = folder;
  std::error_code ignored;
  const bool is_ours = !std::filesystem::exists(folder, ignored);
  std::shared_ptr<recordings::RecordingWriter> fresh;
  const auto finish = [this](recordings::RecordingWriter* writer) {
    delete writer;  // closes its files
    --unfinished_;
  };
  try {
    auto writer = std::make_unique<recordings::RecordingWriter>(std::move(recording));
    ++unfinished_;
    fresh = std::shared_ptr<recordings::RecordingWriter>(writer.release(), finish);
  } catch (const capture::CaptureError&) {  // a full disk: leave no folder of empty files
    if (is_ours) std::filesystem::remove_all(folder, ignored);
    throw;
  }
  const std::scoped_lock lock(mutex_);
  writer_ = std::move(fresh);
  has_writer_ = true;
  ++opened_;
}

void Recorder::close() {
  std::shared_ptr<recordings::RecordingWriter> closing;
  const std::scoped_lock lock(mutex_);
  last_.cameras = writer_->figures();
  last_.failure = writer_->failure();
  closing = std::move(writer_);
  has_writer_ = false;
  until_.reset();
}

}  // namespace huetrack::pipeline
