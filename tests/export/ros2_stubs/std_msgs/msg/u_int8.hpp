#pragma once
#include <cstdint>

namespace std_msgs::msg
{
struct UInt8
{
  std::uint8_t data = 0;
};
}  // namespace std_msgs::msg
