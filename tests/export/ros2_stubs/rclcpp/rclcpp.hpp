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
struct Parameter
{
  std::vector<std::string> words;
  double number = 0.0;
  std::vector<std::string> as_string_array() const { return words; }
  double as_double() const { return number; }
};
}  // namespace rclcpp
