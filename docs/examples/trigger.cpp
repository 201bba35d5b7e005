// Trigger a scanner, wait for the targets of that very image, print them, and move on.
//
// It does what trigger.py does. In a package of yours, CMakeLists.txt needs
//
//     find_package(ament_cmake REQUIRED)
//     find_package(ahf_ros REQUIRED)
//     find_package(rclcpp REQUIRED)
//     find_package(sensor_msgs REQUIRED)
//     find_package(std_srvs REQUIRED)
//     add_executable(trigger trigger.cpp)
//     target_compile_features(trigger PRIVATE cxx_std_17)
//     ament_target_dependencies(trigger ahf_ros rclcpp sensor_msgs std_srvs)
//
// and package.xml the same four as <depend>.

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "ahf_ros/msg/coded_target_array.hpp"
#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "std_srvs/srv/trigger.hpp"

using ahf_ros::msg::CodedTargetArray;
using sensor_msgs::msg::CameraInfo;
using std_srvs::srv::Trigger;
using Seconds = std::chrono::duration<double>;
using Stamp = std::pair<int32_t, uint32_t>;  // seconds and nanoseconds

constexpr Seconds START{30};    // time limit until scanner and detector are there
constexpr Seconds CAPTURE{30};  // ... from the trigger to the header of the image
constexpr Seconds ANSWER{60};   // ... from there to the answer

// Something that did not come in time, or a scanner that refuses.
class Failure : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

template<typename Header>
Stamp stamp_of(const Header & header)
{
  return {header.stamp.sec, header.stamp.nanosec};
}

// Triggers a scanner and knows what was identified in which of its images.
class Cell
{
public:
  Cell()
  : node_(std::make_shared<rclcpp::Node>("cell")),
    trigger_(node_->create_client<Trigger>("capture"))
  {
    // camera_info has the header of the image and is small. It is reliable here, as that of most
    // drivers; a driver that sends it as sensor data needs rclcpp::SensorDataQoS().
    taken_ = node_->create_subscription<CameraInfo>(
      "camera_info", rclcpp::QoS(10),
      [this](const CameraInfo & camera) {stamp_ = stamp_of(camera.header);});
    answered_ = node_->create_subscription<CodedTargetArray>(
      "coded_targets", rclcpp::QoS(1000),
      [this](const CodedTargetArray & answer) {answers_[stamp_of(answer.header)] = answer;});
    executor_.add_node(node_);
  }

  // Wait until what is needed is there.
  void wait()
  {
    until(
      std::string("service ") + trigger_->get_service_name(), START,
      [this] {return trigger_->service_is_ready();});
    until(
      std::string("a publisher of ") + answered_->get_topic_name(), START,
      [this] {return answered_->get_publisher_count() > 0;});
    until(
      std::string("a publisher of ") + taken_->get_topic_name(), START,
      [this] {return taken_->get_publisher_count() > 0;});
  }

  // Trigger the scanner and return the answer to the image that it takes.
  CodedTargetArray shot()
  {
    stamp_.reset();
    answers_.clear();
    auto called = trigger_->async_send_request(std::make_shared<Trigger::Request>());
    try {
      until(
        "the response of the scanner", CAPTURE,
        [&called] {return called.wait_for(Seconds::zero()) == std::future_status::ready;});
    } catch (const Failure &) {
      trigger_->remove_pending_request(called);
      throw;
    }
    const auto response = called.get();
    if (!response->success) {
      throw Failure("the scanner refuses: " + response->message);
    }
    until("the camera_info of the image", CAPTURE, [this] {return stamp_.has_value();});
    const Stamp stamp = *stamp_;
    until(
      "the answer to the image of second " + std::to_string(stamp.first), ANSWER,
      [this, stamp] {return answers_.count(stamp) > 0;});
    return answers_.at(stamp);
  }

private:
  // Return when a condition holds, or throw a Failure that says what did not come.
  void until(const std::string & what, Seconds limit, const std::function<bool()> & condition)
  {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!condition()) {
      if (!rclcpp::ok()) {
        throw Failure("interrupted");
      }
      if (std::chrono::steady_clock::now() > end) {
        throw Failure(what + " did not come in time");
      }
      executor_.spin_once(std::chrono::milliseconds(50));
    }
  }

  rclcpp::Node::SharedPtr node_;
  rclcpp::Client<Trigger>::SharedPtr trigger_;
  rclcpp::Subscription<CameraInfo>::SharedPtr taken_;
  rclcpp::Subscription<CodedTargetArray>::SharedPtr answered_;
  rclcpp::executors::SingleThreadedExecutor executor_;
  std::optional<Stamp> stamp_;  // of the last image
  std::map<Stamp, CodedTargetArray> answers_;
};

int main(int argc, char ** argv)
{
  const auto arguments = rclcpp::init_and_remove_ros_arguments(argc, argv);
  const int shots = arguments.size() > 1 ? std::atoi(arguments[1].c_str()) : 1;
  int failed = 0;
  Cell cell;
  std::printf("shot,id,x,y,family\n");
  try {
    cell.wait();
  } catch (const Failure & error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  for (int number = 1; number <= shots && rclcpp::ok(); ++number) {
    // This is where a robot or a turntable would be moved.
    try {
      const auto answer = cell.shot();
      for (const auto & it : answer.targets) {
        std::printf("%d,%d,%.3f,%.3f,%s\n", number, it.id, it.x, it.y, it.family.c_str());
      }
      std::fflush(stdout);
      const bool good = answer.status == CodedTargetArray::OK;
      std::fprintf(
        stderr, "shot %d %s%s\n", number, good ? "ok " : "not identified: ",
        answer.reason.c_str());
      failed += good ? 0 : 1;
    } catch (const Failure & error) {
      std::fprintf(stderr, "shot %d: %s\n", number, error.what());
      failed += 1;
    }
  }
  rclcpp::shutdown();
  return failed ? 1 : 0;
}
