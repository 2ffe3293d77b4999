#include "publish/estimate_publisher.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cassert>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <shared_mutex>
#include <stdexcept>

#include "capture/timing/capture_clock.h"
#include "idl/camera_hostPubSubTypes.h"
#include "idl/camera_timesPubSubTypes.h"
#include "idl/dds_participant.h"
#include "idl/huetrackPubSubTypes.h"
#include "idl/object_setPubSubTypes.h"
#include "idl/ros2_messagesPubSubTypes.h"
#include "idl/topics.h"
#include "publish/ros_messages.h"

namespace huetrack::publish {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

namespace {

std::int64_t unix_ns(capture::Timestamp t) {
  return t.time_since_epoch().count();
}

// Enums are sent as numbers; these checks keep both lists equal.
static_assert(static_cast<std::uint32_t>(object_tracking::TrackState::searching) == msg::TRACK_STATE_SEARCHING &&
              static_cast<std::uint32_t>(object_tracking::TrackState::tracking) == msg::TRACK_STATE_TRACKING &&
              static_cast<std::uint32_t>(object_tracking::TrackState::coasting) == msg::TRACK_STATE_COASTING &&
              static_cast<std::uint32_t>(object_tracking::TrackState::lost) == msg::TRACK_STATE_LOST);
static_assert(static_cast<std::uint32_t>(CameraStatus::Health::waiting) == msg::CAMERA_HEALTH_WAITING &&
              static_cast<std::uint32_t>(CameraStatus::Health::delivering) == msg::CAMERA_HEALTH_DELIVERING &&
              static_cast<std::uint32_t>(CameraStatus::Health::stalled) == msg::CAMERA_HEALTH_STALLED &&
              static_cast<std::uint32_t>(CameraStatus::Health::absent) == msg::CAMERA_HEALTH_ABSENT &&
              static_cast<std::uint32_t>(CameraStatus::Health::ended) == msg::CAMERA_HEALTH_ENDED);

static_assert(static_cast<std::uint32_t>(camera_tracking::PoseState::searching) == msg::CAMERA_STATE_SEARCHING &&
              static_cast<std::uint32_t>(camera_tracking::PoseState::tracking) == msg::CAMERA_STATE_TRACKING &&
              static_cast<std::uint32_t>(camera_tracking::PoseState::coasting) == msg::CAMERA_STATE_COASTING &&
              static_cast<std::uint32_t>(camera_tracking::PoseState::lost) == msg::CAMERA_STATE_LOST);

std::array<double, 3> array_of(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

// All fields except the constant names, and published_at, which is set last.
// Without a position by its state, the fields are NaN, whatever the estimate contains.
template <typename Sample>
void fill_motion(Sample& sample, const object_tracking::ObjectEstimate& estimate) {
  const Eigen::Vector3d none = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  const bool valid = estimate.has_position();
  sample.position(array_of(valid ? estimate.position : none));
  sample.velocity(array_of(valid ? estimate.velocity : none));
  for (Eigen::Index i = 0; i < 9; ++i)
    sample.covariance()[static_cast<std::size_t>(i)] = valid ? estimate.covariance(i / 3, i % 3) : none.x();
  sample.views(static_cast<std::uint32_t>(estimate.views));
  sample.confidence(estimate.confidence);
}

void fill(msg::ObjectPosition& sample, const object_tracking::ObjectEstimate& estimate, capture::Timestamp captured,
          capture::Timestamp received) {
  sample.captured_at(unix_ns(captured));
  sample.received_at(unix_ns(received));
  sample.set_number(estimate.set_number);
  sample.state(static_cast<msg::TrackState>(estimate.state));
  fill_motion(sample, estimate);
  const Eigen::Vector3d none = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  sample.map_position(array_of(estimate.has_position() ? estimate.map_position : none));
  sample.particle_count(static_cast<std::uint32_t>(estimate.particle_count));
  sample.effective_sample_size(estimate.effective_sample_size);
  for (std::size_t i = 0; i < sample.per_view().size(); ++i) {
    const object_tracking::ViewSupport view =
        i < estimate.per_view.size() ? estimate.per_view[i] : object_tracking::ViewSupport{};
    msg::ViewSupport& out = sample.per_view()[i];
    out.delivered(view.delivered);
    out.in_view(view.in_view);
    out.seen(view.seen);
    out.pixel({view.px.x(), view.px.y()});
    out.radius_px(view.radius_px);
    out.support(view.support);
    out.residual_px(view.residual_px);
  }
}

void fill(msg::ObjectInSet& sample, const object_tracking::ObjectEstimate& estimate, const std::string& name) {
  sample.name(name);
  sample.number(estimate.object);
  sample.state(static_cast<std::uint32_t>(estimate.state));
  sample.is_birth(estimate.is_birth);
  sample.is_end(estimate.is_end);
  fill_motion(sample, estimate);
}

void fill(msg::CameraPose& sample, const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured,
          capture::Timestamp received) {
  sample.captured_at(unix_ns(captured));
  sample.received_at(unix_ns(received));
  sample.frame_number(estimate.frame_number);
  sample.state(static_cast<msg::CameraState>(estimate.state));
  const bool valid = estimate.has_pose();
  const double none = std::numeric_limits<double>::quiet_NaN();
  sample.position(array_of(valid ? estimate.world_from_camera.translation : Eigen::Vector3d::Constant(none)));
  const auto& q = estimate.world_from_camera.rotation;
  if (valid)
    sample.orientation({q.x(), q.y(), q.z(), q.w()});
  else
    sample.orientation({none, none, none, none});
  for (Eigen::Index i = 0; i < 36; ++i)
    sample.covariance()[static_cast<std::size_t>(i)] = valid ? estimate.covariance(i / 6, i % 6) : none;
  sample.features_in_view(static_cast<std::uint32_t>(estimate.features_in_view));
  sample.features_matched(static_cast<std::uint32_t>(estimate.features_matched));
  sample.map_points(static_cast<std::uint32_t>(estimate.map_points));
  sample.confidence(estimate.confidence);
  sample.particle_count(static_cast<std::uint32_t>(estimate.particle_count));
  sample.effective_sample_size(estimate.effective_sample_size);
}

void fill(msg::ServiceStatus& sample, const ServiceStatus& status) {
  sample.at(unix_ns(status.at));
  sample.program_version(status.program_version);
  sample.mode(status.mode);
  sample.config_file(status.config_file);
  sample.config_identity(status.config_identity);
  sample.rig_identity(status.rig_identity);
  sample.rig_history(status.rig_history);
  sample.clock_offset_s(status.clock_offset_s);
  sample.set_rate_hz(status.set_rate_hz);
  sample.sets(status.sets);
  sample.incomplete_sets(status.incomplete_sets);
  sample.late_frames(status.late_frames);
  sample.dropped_sets(status.dropped_sets);
  sample.cameras().resize(status.cameras.size());
  for (std::size_t i = 0; i < status.cameras.size(); ++i) {
    const CameraStatus& camera = status.cameras[i];
    msg::CameraStatus& out = sample.cameras()[i];
    out.name(camera.name);
    out.health(static_cast<msg::CameraHealth>(camera.health));
    out.message(camera.message);
    out.frames(camera.frames);
    out.dropped(camera.dropped);
    out.corrupted(camera.corrupted);
    out.rate_hz(camera.rate_hz);
    out.age_s(camera.age_s);
  }
  sample.targets(status.targets);
  sample.warnings(status.warnings);
}

void fill(msg::HostClocks& sample, const ServiceStatus& status) {
  sample.at(unix_ns(status.at));
  sample.clocks().resize(status.clocks.size());
  for (std::size_t i = 0; i < status.clocks.size(); ++i) {
    const capture::HostClock& clock = status.clocks[i].clock;
    msg::HostClock& out = sample.clocks()[i];
    out.host(clock.host);
    out.cameras(status.clocks[i].cameras);
    out.is_known(clock.is_known);
    out.offset_s(clock.offset_s);
    out.offset_sigma_s(clock.sigma_s);
    out.drift(clock.drift);
    out.round_trip_s(clock.round_trip_s);
    out.is_same_machine(clock.is_ours);
    out.kept_s(clock.kept_s.value_or(std::numeric_limits<double>::quiet_NaN()));
    out.is_contradicted(clock.is_contradicted);
    out.advice(clock.advice);
  }
}

// Discovers other writers of our topics: readers would get the positions of both services, interleaved. thread-safe:
// called from Fast DDS' threads.
class Rivals : public dds::DomainParticipantListener {
 public:
  explicit Rivals(idl::PublisherIdentity self) : self_(std::move(self)) {}

  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) override {
    const rtps::GUID_t guid = info.info.guid();
    if (info.info.topicName() != idl::object_position_topic) return;
    const std::lock_guard lock(mutex_);
    if (info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
      others_.erase(guid);
      return;
    }
    const auto& bytes = info.info.m_qos.m_userData;
    auto other = idl::PublisherIdentity::from(std::string(bytes.begin(), bytes.end()));
    if (!other || (other->host == self_.host && other->pid == self_.pid)) return;  // this process, while joining again
    others_[guid] = std::move(*other);
  }

  std::vector<std::string> warnings() const {
    std::vector<std::string> sentences;
    const std::lock_guard lock(mutex_);
    for (const auto& [guid, other] : others_)
      for (const std::string& target : self_.targets)
        if (std::ranges::find(other.targets, target) != other.targets.end())
          sentences.push_back("target " + target + " is also published by a second huetrackd (process " +
                              std::to_string(other.pid) + " on " + other.host +
                              "): stop one of them, or give it another domain or target name");
    return sentences;
  }

  const idl::PublisherIdentity& self() const { return self_; }

 private:
  const idl::PublisherIdentity self_;
  mutable std::mutex mutex_;
  std::map<rtps::GUID_t, idl::PublisherIdentity> others_;  // guarded by mutex_
};

int count_of(const EstimatePublisherOptions& options, std::size_t target) {
  return target < options.counts.size() ? options.counts[target] : 1;
}

bool has_several(const EstimatePublisherOptions& options) {
  return std::ranges::any_of(options.counts, [](int count) { return count > 1; });
}

// A participant with its writers; replaced when the network changes.
struct Connection {
  Connection(const EstimatePublisherOptions& options, Rivals& rivals)
      : participant(options.transport("huetrackd"), &rivals),
        position(participant.create_writer<msg::ObjectPositionPubSubType>(
            idl::object_position_topic, idl::object_position_writer_qos(), rivals.self().user_data())),
        status(participant.create_writer<msg::ServiceStatusPubSubType>(idl::status_topic, idl::status_writer_qos(),
                                                                       rivals.self().user_data())),
        times(participant.create_writer<msg::CameraTimesPubSubType>(idl::camera_times_topic, idl::status_writer_qos(),
                                                                    rivals.self().user_data())) {
    if (!options.tracked_camera.empty())
      camera = &participant.create_writer<msg::CameraPosePubSubType>(
          idl::camera_pose_topic, idl::object_position_writer_qos(),
          idl::PublisherIdentity::of_this_process({options.tracked_camera}).user_data());
    if (options.has_other_hosts)
      clocks = &participant.create_writer<msg::HostClocksPubSubType>(idl::host_clocks_topic, idl::status_writer_qos(),
                                                                     rivals.self().user_data());
    if (has_several(options))
      sets = &participant.create_writer<msg::ObjectSetPubSubType>(
          idl::object_set_topic, idl::object_position_writer_qos(), rivals.self().user_data());
    if (!options.ros2) return;
    for (std::size_t t = 0; t < options.targets.size(); ++t) {
      const std::string& target = options.targets[t];
      const bool is_several = count_of(options, t) > 1;
      poses.push_back(is_several ? nullptr : &create_pose_writer(idl::ros2_pose_topic(target)));
      pose_arrays.push_back(is_several
                                ? &participant.create_ros2_writer<geometry_msgs::msg::dds_::PoseArray_PubSubType>(
                                      idl::ros2_poses_topic(target), idl::ros2_poses_type_hash)
                                : nullptr);
    }
    if (!options.tracked_camera.empty())
      ros_camera = &create_pose_writer(idl::ros2_camera_pose_topic(options.tracked_camera));
    tf = &participant.create_ros2_writer<tf2_msgs::msg::dds_::TFMessage_PubSubType>(idl::ros2_tf_topic,
                                                                                    idl::ros2_tf_type_hash);
  }

  // Waits for the last samples to arrive.
  ~Connection() {
    position.wait_for_acknowledgments(eprosima::fastrtps::Duration_t(0, 500'000'000));
    if (camera != nullptr) camera->wait_for_acknowledgments(eprosima::fastrtps::Duration_t(0, 500'000'000));
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  dds::DataWriter& create_pose_writer(const std::string& topic) {
    return participant.create_ros2_writer<geometry_msgs::msg::dds_::PoseWithCovarianceStamped_PubSubType>(
        topic, idl::ros2_pose_type_hash);
  }
  // Of one object of several; created with its first pose.
  dds::DataWriter& pose_writer_of(const std::string& object) {
    const std::lock_guard lock(objects_mutex);
    const auto [at, is_new] = object_poses.try_emplace(object, nullptr);
    if (is_new) at->second = &create_pose_writer(idl::ros2_pose_topic(object));
    return *at->second;
  }
  void end(const std::string& object) {
    const std::lock_guard lock(objects_mutex);
    const auto at = object_poses.find(object);
    if (at == object_poses.end()) return;
    participant.delete_writer(*at->second);
    object_poses.erase(at);
  }

  idl::DdsParticipant participant;
  dds::DataWriter& position;
  dds::DataWriter& status;
  dds::DataWriter& times;
  // By target, empty without ROS 2; poses: null for targets with count > 1, arrays: null for others.
  std::vector<dds::DataWriter*> poses, pose_arrays;
  std::mutex objects_mutex;
  std::map<std::string, dds::DataWriter*> object_poses;  // guarded by objects_mutex; by the object's name
  dds::DataWriter* sets = nullptr;                       // null without targets with count > 1
  dds::DataWriter* clocks = nullptr;                     // null without remote cameras
  dds::DataWriter* tf = nullptr;                         // null without ROS 2
  dds::DataWriter* camera = nullptr;                     // null without a tracked camera
  dds::DataWriter* ros_camera = nullptr;
};

}  // namespace

std::vector<std::string> EstimatePublisherOptions::problems() const {
  std::vector<std::string> sentences;
  if (frame_id.empty() || frame_id.front() == '/')
    sentences.push_back("frame_id \"" + frame_id + "\" must not be empty nor begin with '/'");
  const auto check_name = [&](const char* whose, const std::string& name) {
    if (!idl::is_target_name(name))
      sentences.push_back(
          std::string(whose) + " \"" + name + "\" must be a letter, then letters, digits and single '_', " +
          std::to_string(idl::longest_name) + " characters at most: it is part of a ROS 2 topic's name");
  };
  if (!tracked_camera.empty()) check_name("camera", tracked_camera);
  if (std::ranges::find(targets, tracked_camera) != targets.end())
    sentences.push_back("target " + tracked_camera +
                        " has the name of the tracked camera, but both are frames on /tf: rename the target");
  for (const std::string& target : targets) check_name("target", target);
  if (std::set(targets.begin(), targets.end()).size() != targets.size())
    sentences.push_back("two targets have the same name");
  return sentences;
}

struct EstimatePublisher::Impl {
  struct Target {
    msg::ObjectPosition position;  // its names are set once
    geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ pose;
    tf2_msgs::msg::dds_::TFMessage_ tf;
    msg::ObjectSet set;  // its name is set once
    geometry_msgs::msg::dds_::PoseArray_ poses;
  };

  explicit Impl(EstimatePublisherOptions o)
      : options(std::move(o)),
        rivals(idl::PublisherIdentity::of_this_process(options.targets)),
        connection(std::make_unique<Connection>(options, rivals)) {
    for (const std::string& name : options.targets) {
      Target& target = targets.emplace_back();
      target.position.target(name);
      target.set.target(name);
      for (const std::string& camera : options.cameras) target.position.per_view().emplace_back().camera(camera);
    }
    camera_sample.camera(options.tracked_camera);
    const auto sign = [&](auto&... samples) {
      (samples.host(rivals.self().host), ...);
      (samples.pid(rivals.self().pid), ...);
    };
    sign(status, times, clocks);
    status.frame_id(options.frame_id);
  }

  // The status thread only. Creates the new connection first, so that publish() hardly waits.
  void rejoin() {
    std::string why_not;
    try {
      auto fresh = std::make_unique<Connection>(options, rivals);
      const std::unique_lock lock(connection_mutex);
      std::swap(connection, fresh);
    } catch (const std::invalid_argument& error) {  // a configured interface is gone
      why_not = error.what();
    } catch (const std::runtime_error& error) {  // Fast DDS refuses
      why_not = error.what();
    }
    const std::lock_guard lock(problem_mutex);
    network_problem =
        why_not.empty() ? "" : "the network has changed, but DDS still uses the old addresses: " + why_not;
  }

  bool count(bool ok) {
    if (!ok) ++failures;
    return ok;
  }

  const EstimatePublisherOptions options;
  Rivals rivals;  // declared before connection, which it outlives
  mutable std::shared_mutex connection_mutex;
  std::unique_ptr<Connection>
      connection;  // guarded by connection_mutex: shared to write to it, exclusive to replace it
  std::vector<Target> targets;
  // The camera's thread only.
  msg::CameraPose camera_sample;  // its name is set once
  geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ camera_pose;
  tf2_msgs::msg::dds_::TFMessage_ camera_tf;
  msg::ServiceStatus status;  // its names are set once
  msg::CameraTimes times;     // its names are set once
  msg::HostClocks clocks;     // its names are set once
  std::atomic<std::uint64_t> published = 0;
  std::atomic<std::uint64_t> failures = 0;
  mutable std::mutex problem_mutex;
  std::string network_problem;  // guarded by problem_mutex
};

EstimatePublisher::EstimatePublisher(EstimatePublisherOptions options) {
  if (const auto problems = options.problems(); !problems.empty())
    throw std::invalid_argument(fmt::format("publishing over DDS: {}", fmt::join(problems, "; ")));
  impl_ = std::make_unique<Impl>(std::move(options));
}

std::vector<std::string> EstimatePublisher::check(const EstimatePublisherOptions& options) {
  return huetrack::idl::check(options.transport("huetrackd"));
}

EstimatePublisher::Network EstimatePublisher::network(const EstimatePublisherOptions& options) {
  Network network{.domain = idl::resolve_domain(options.domain), .interfaces = {}};
  for (const auto& interface : idl::network_interfaces()) {
    const bool is_loopback = interface.address.starts_with("127.");
    const bool is_named = std::ranges::any_of(options.interfaces, [&](const std::string& wanted) {
      return wanted == interface.name || wanted == interface.address;
    });
    if (options.interfaces.empty() || is_loopback || is_named)
      network.interfaces.push_back(interface.name + " " + interface.address);
  }
  return network;
}

EstimatePublisher::~EstimatePublisher() = default;

bool EstimatePublisher::publish(std::size_t target, const object_tracking::ObjectEstimate& estimate,
                                capture::Timestamp captured, capture::Timestamp received, Writing* writing) noexcept {
  assert(target < impl_->targets.size());
  assert(estimate.per_view.empty() || estimate.per_view.size() == impl_->options.cameras.size());
  Impl::Target& to = impl_->targets[target];
  const std::string& name = impl_->options.targets[target];
  const bool is_several = count_of(impl_->options, target) > 1;
  try {
    if (is_several) to.position.target(object_tracking::object_name(name, estimate.object));
    fill(to.position, estimate, captured, received);
    const std::shared_lock lock(impl_->connection_mutex);
    Connection& bus = *impl_->connection;
    to.position.published_at(unix_ns(std::chrono::system_clock::now()));
    const capture::Timestamp begun = capture::unix_now();
    bool ok = bus.position.write(&to.position);
    if (writing != nullptr) *writing = {begun, capture::unix_now()};
    if (ok) ++impl_->published;
    if (impl_->options.ros2 && estimate.has_position()) {
      to_ros(estimate, captured, impl_->options.frame_id, to.pose);
      to_ros(estimate, captured, impl_->options.frame_id, to.position.target(), to.tf);
      dds::DataWriter& pose = is_several ? bus.pose_writer_of(to.position.target()) : *bus.poses[target];
      ok = pose.write(&to.pose) && ok;
      ok = bus.tf->write(&to.tf) && ok;
    }
    if (estimate.is_end) {
      // Dispose the instance: informs readers and frees memory.
      using eprosima::fastrtps::types::ReturnCode_t;
      ok = bus.position.unregister_instance(&to.position, dds::HANDLE_NIL) == ReturnCode_t::RETCODE_OK && ok;
      if (impl_->options.ros2) bus.end(to.position.target());
    }
    return impl_->count(ok);
  } catch (const std::exception&) {  // a refused topic, or an exception of Fast CDR
    return impl_->count(false);
  }
}

bool EstimatePublisher::publish_set(std::size_t target, std::span<const object_tracking::ObjectEstimate> estimates,
                                    capture::Timestamp captured, capture::Timestamp received) noexcept {
  assert(count_of(impl_->options, target) > 1);
  Impl::Target& to = impl_->targets[target];
  to.set.captured_at(unix_ns(captured));
  to.set.received_at(unix_ns(received));
  to.set.set_number(estimates.empty() ? 0 : estimates.front().set_number);
  to.set.most(static_cast<std::uint32_t>(count_of(impl_->options, target)));
  to.set.objects().clear();
  for (const auto& estimate : estimates) {
    if (estimate.object == 0) continue;  // no object
    fill(to.set.objects().emplace_back(), estimate,
         object_tracking::object_name(impl_->options.targets[target], estimate.object));
  }
  const std::shared_lock lock(impl_->connection_mutex);
  Connection& bus = *impl_->connection;
  to.set.published_at(unix_ns(std::chrono::system_clock::now()));
  bool ok = bus.sets->write(&to.set);
  if (impl_->options.ros2) {
    to_ros(estimates, captured, impl_->options.frame_id, to.poses);
    ok = bus.pose_arrays[target]->write(&to.poses) && ok;
  }
  return impl_->count(ok);
}

bool EstimatePublisher::publish(const camera_tracking::CameraEstimate& estimate, capture::Timestamp captured,
                                capture::Timestamp received) noexcept {
  assert(!impl_->options.tracked_camera.empty());
  fill(impl_->camera_sample, estimate, captured, received);
  const std::shared_lock lock(impl_->connection_mutex);
  Connection& bus = *impl_->connection;
  impl_->camera_sample.published_at(unix_ns(std::chrono::system_clock::now()));
  bool ok = bus.camera->write(&impl_->camera_sample);
  if (ok) ++impl_->published;
  if (impl_->options.ros2 && estimate.has_pose()) {
    to_ros(estimate, captured, impl_->options.frame_id, impl_->camera_pose);
    to_ros(estimate, captured, impl_->options.frame_id, impl_->options.tracked_camera, impl_->camera_tf);
    ok = bus.ros_camera->write(&impl_->camera_pose) && ok;
    ok = bus.tf->write(&impl_->camera_tf) && ok;
  }
  return impl_->count(ok);
}

bool EstimatePublisher::publish_status(const ServiceStatus& status) noexcept {
  if (impl_->connection->participant.network_changed()) impl_->rejoin();  // only this thread replaces it
  fill(impl_->status, status);
  const Counters now = counters();
  impl_->status.published(now.published);
  impl_->status.publish_failures(now.failures);
  if (impl_->connection->clocks != nullptr) {
    fill(impl_->clocks, status);
    impl_->count(impl_->connection->clocks->write(&impl_->clocks));
  }
  return impl_->count(impl_->connection->status.write(&impl_->status));
}

bool EstimatePublisher::publish_times(capture::Timestamp at,
                                      std::span<const object_tracking::CameraTimingEstimate> times) noexcept {
  impl_->times.at(unix_ns(at));
  impl_->times.cameras().resize(times.size());
  for (std::size_t c = 0; c < times.size(); ++c) {
    msg::CameraTime& out = impl_->times.cameras()[c];
    out.camera(impl_->options.cameras[c]);
    out.latency_s(times[c].latency_s);
    out.latency_sigma_s(times[c].latency_sigma_s);
    out.readout_s(times[c].readout_s);
    out.readout_sigma_s(times[c].readout_sigma_s);
  }
  return impl_->count(impl_->connection->times.write(&impl_->times));
}

EstimatePublisher::Counters EstimatePublisher::counters() const {
  return {impl_->published, impl_->failures};
}

std::vector<std::string> EstimatePublisher::warnings() const {
  std::vector<std::string> sentences = impl_->rivals.warnings();
  const std::lock_guard lock(impl_->problem_mutex);
  if (!impl_->network_problem.empty()) sentences.push_back(impl_->network_problem);
  return sentences;
}

int EstimatePublisher::subscribers() const {
  dds::PublicationMatchedStatus matched;
  const std::shared_lock lock(impl_->connection_mutex);
  impl_->connection->position.get_publication_matched_status(matched);
  int readers = matched.current_count;
  if (impl_->connection->camera != nullptr) {
    impl_->connection->camera->get_publication_matched_status(matched);
    readers += matched.current_count;
  }
  return readers;
}

int EstimatePublisher::domain() const {
  const std::shared_lock lock(impl_->connection_mutex);
  return impl_->connection->participant.domain();
}

std::string EstimatePublisher::description() const {
  const std::shared_lock lock(impl_->connection_mutex);
  return impl_->connection->participant.description();
}

}  // namespace huetrack::publish
