#pragma once
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#define RCLCPP_ERROR(logger, ...) ((void)(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))

namespace rclcpp
{
class Time
{
};
class Duration
{
public:
  explicit Duration(double seconds) : seconds_(seconds) {}
  double seconds() const { return seconds_; }

private:
  double seconds_;
};
struct SystemDefaultsQoS
{
};
struct Logger
{
};
template <typename Message>
struct Subscription
{
  using SharedPtr = std::shared_ptr<Subscription<Message>>;
  std::function<void(std::shared_ptr<Message>)> callback;
};
template <typename Message>
struct Publisher
{
  using SharedPtr = std::shared_ptr<Publisher<Message>>;
  void publish(const Message & message) { std::printf("%d\n", static_cast<int>(message.data)); }
};
template <typename Message, typename Node>
typename Publisher<Message>::SharedPtr create_publisher(
  const Node &, const std::string &, const SystemDefaultsQoS &)
{
  return std::make_shared<Publisher<Message>>();
}
struct TimerBase
{
  using SharedPtr = std::shared_ptr<TimerBase>;
  std::function<void()> callback;
};
struct Parameter
{
  std::vector<std::string> words;
  double number = 0.0;
  std::vector<std::string> as_string_array() const { return words; }
  double as_double() const { return number; }
};
}  // namespace rclcpp
