// Steps a controller as the controller manager would: commands from standard input, pressures to output.
// A line is "configure", "activate", "deactivate", "chained K", "say X ...", "reference X ...", "state X ..."
// "update" or "status", which the timer publishes.
#include <cstdio>
#include <iostream>
#include <sstream>

#include CONTROLLER_HEADER

using Message = std_msgs::msg::Float64MultiArray;

static std::vector<double> numbers(std::istringstream & line)
{
  std::vector<double> found;
  for (std::string word; line >> word;) {
    found.push_back(std::stod(word));
  }
  return found;
}

int main(int argc, char ** argv)
{
  std::vector<double> commands(N_COMMANDS, -1.0), states(N_STATES, 0.0);
  CONTROLLER controller;
  auto ok = controller_interface::CallbackReturn::SUCCESS;
  if (controller.on_init() != ok) {
    return 1;
  }
  auto & parameters = controller.get_node()->parameters;
  for (int k = 1; k + 1 < argc; k += 2) {
    parameters[argv[k]].number = std::stod(argv[k + 1]);
  }
  parameters["command_interfaces"].words.assign(N_COMMANDS, "valve/pressure");
  parameters["state_interfaces"].words.assign(N_STATES, "sensor/value");
  controller.loan(commands, states);
  std::vector<hardware_interface::CommandInterface> references;
  for (std::string text; std::getline(std::cin, text);) {
    std::istringstream line(text);
    std::string what;
    line >> what;
    if (what == "configure") {
      if (controller.on_configure({}) != ok) {
        return 2;
      }
      references = controller.references();
      for (const auto & each : references) {
        std::printf("%s\n", each.get_name().c_str());
      }
    } else if (what == "activate") {
      controller.on_activate({});
    } else if (what == "deactivate") {
      controller.on_deactivate({});
    } else if (what == "chained") {
      controller.set_chained_mode(numbers(line).at(0) != 0.0);
    } else if (what == "say") {
      auto message = std::make_shared<Message>();
      message->data = numbers(line);
      std::static_pointer_cast<rclcpp::Subscription<Message>>(controller.get_node()->subscription)
        ->callback(message);
    } else if (what == "reference") {
      const auto given = numbers(line);
      for (std::size_t k = 0; k < given.size(); k++) {
        (void)references.at(k).set_value(given[k]);
      }
    } else if (what == "state") {
      const auto given = numbers(line);
      std::copy(given.begin(), given.end(), states.begin());
    } else if (what == "status") {
      controller.get_node()->timer->callback();
    } else if (what == "update") {
      controller.update(rclcpp::Time(), rclcpp::Duration(0.01));
    }
    if (what == "update" || what == "deactivate") {
      for (double each : commands) {
        std::printf("%.17g ", each);
      }
      std::printf("\n");
    }
  }
  return 0;
}
