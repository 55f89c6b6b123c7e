#pragma once
#include <map>

#include "rclcpp/rclcpp.hpp"

namespace rclcpp_lifecycle
{
class State
{
};
namespace node_interfaces
{
class LifecycleNodeInterface
{
public:
  enum class CallbackReturn : unsigned char { SUCCESS, FAILURE, ERROR };
  virtual ~LifecycleNodeInterface() = default;
  virtual CallbackReturn on_configure(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const State &) { return CallbackReturn::SUCCESS; }
};
}  // namespace node_interfaces
class LifecycleNode
{
public:
  const char * get_name() const { return "controller"; }
  rclcpp::Logger get_logger() const { return {}; }
  rclcpp::Parameter get_parameter(const std::string & name) const { return parameters.at(name); }
  template <typename Message, typename Callback>
  std::shared_ptr<rclcpp::Subscription<Message>> create_subscription(
    const std::string &, const rclcpp::SystemDefaultsQoS &, Callback && callback)
  {
    auto made = std::make_shared<rclcpp::Subscription<Message>>();
    made->callback = callback;
    subscription = made;
    return made;
  }
  template <typename Period, typename Callback>
  rclcpp::TimerBase::SharedPtr create_wall_timer(Period, Callback && callback)
  {
    timer = std::make_shared<rclcpp::TimerBase>();
    timer->callback = callback;
    return timer;
  }
  std::map<std::string, rclcpp::Parameter> parameters;
  rclcpp::TimerBase::SharedPtr timer;
  std::shared_ptr<void> subscription;
};
}  // namespace rclcpp_lifecycle
