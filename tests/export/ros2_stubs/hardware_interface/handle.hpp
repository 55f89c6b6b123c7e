#pragma once
#include <string>

namespace hardware_interface
{
class CommandInterface
{
public:
  CommandInterface(const std::string & prefix, const std::string & name, double * value)
  : name_(prefix + "/" + name), value_(value)
  {
  }
  const std::string & get_name() const { return name_; }
  [[nodiscard]] bool set_value(double value)
  {
    *value_ = value;
    return true;
  }

private:
  std::string name_;
  double * value_;
};
class LoanedCommandInterface
{
public:
  explicit LoanedCommandInterface(double * value) : value_(value) {}
#ifdef OLDER_HANDLES
  void set_value(double value) { *value_ = value; }
#else
  [[nodiscard]] bool set_value(double value)
  {
    *value_ = value;
    return true;
  }
#endif

private:
  double * value_;
};
}  // namespace hardware_interface
