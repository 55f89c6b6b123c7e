#pragma once
#include <optional>

namespace hardware_interface
{
class LoanedStateInterface
{
public:
  explicit LoanedStateInterface(const double * value) : value_(value) {}
#ifdef OLDER_HANDLES
  double get_value() const { return *value_; }
#else
  template <typename T = double>
  [[nodiscard]] std::optional<T> get_optional() const
  {
    return *value_;
  }
#endif

private:
  const double * value_;
};
}  // namespace hardware_interface
