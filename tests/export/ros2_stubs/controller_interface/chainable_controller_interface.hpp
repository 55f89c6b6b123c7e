#pragma once
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "hardware_interface/handle.hpp"
#include "hardware_interface/loaned_state_interface.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"

namespace controller_interface
{
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
enum class return_type : unsigned char { OK = 0, ERROR = 1 };
enum class interface_configuration_type : unsigned char { ALL = 0, INDIVIDUAL = 1, NONE = 2 };
struct InterfaceConfiguration
{
  interface_configuration_type type;
  std::vector<std::string> names = {};
};

class ChainableControllerInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface
{
public:
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual return_type update_and_write_commands(
    const rclcpp::Time & time, const rclcpp::Duration & period) = 0;
  return_type update(const rclcpp::Time & time, const rclcpp::Duration & period)
  {
    if (!chained) {
      update_reference_from_subscribers(time, period);
    }
    return update_and_write_commands(time, period);
  }
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
  unsigned int get_update_rate() const { return update_rate; }
  bool set_chained_mode(bool wanted)
  {
    chained = wanted;
    return on_set_chained_mode(wanted);
  }
  std::vector<hardware_interface::CommandInterface> references()
  {
    return on_export_reference_interfaces();
  }

  void loan(std::vector<double> & commands, const std::vector<double> & states)
  {
    for (double & each : commands) {
      command_interfaces_.emplace_back(&each);
    }
    for (const double & each : states) {
      state_interfaces_.emplace_back(&each);
    }
  }
  bool chained = false;
  unsigned int update_rate = 100;

protected:
  virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() = 0;
  virtual bool on_set_chained_mode(bool chained_mode) = 0;
  virtual return_type update_reference_from_subscribers(
    const rclcpp::Time & time, const rclcpp::Duration & period) = 0;

  template <typename T>
  T auto_declare(const std::string & name, const T & value)
  {
    rclcpp::Parameter made;
    if constexpr (std::is_same_v<T, double>) {
      made.number = value;
    } else {
      made.words = value;
    }
    node_->parameters.emplace(name, made);
    return value;
  }

  std::vector<double> reference_interfaces_;
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ =
    std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};
}  // namespace controller_interface
