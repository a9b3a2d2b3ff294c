#pragma once
/// @file command_line.hpp
/// Options of our programs. A facade over CLI11, which costs ten seconds of compilation in every unit that includes it:
/// only command_line.cpp does.
///
/// Values are written into the variables that the options were made with, which have to outlive parse().
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace rtbus {

/// One option of a command. A handle: copies mean the same option. Each call returns it for the next one.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option& required();
  /// Shows the variable's present value as the default in --help.
  Option& show_default();
  /// What --help shows for the value: "FILE".
  Option& type_name(const std::string& name);
  /// May be given several times; each value is kept.
  Option& take_all();
  /// One value may hold several, parted by `character`.
  Option& delimiter(char character);
  Option& excludes(const Option& other);
  Option& range(double low, double high);
  Option& whole_range(int low, int high);  ///< As range(), for whole numbers.
  Option& positive();
  Option& one_of(const std::vector<std::string>& words);
  Option& existing_file();
  /// `complaint` returns an empty text for a value that is fine, else what is wrong with it.
  Option& check(std::function<std::string(const std::string& value)> complaint);

 private:
  CLI::Option* option_;
};

/// A program or one of its commands. A handle, as Option is.
class Command {
 public:
  explicit Command(CLI::App* app) : app_(app) {}

  /// `names` as CLI11 reads them: "-s,--session", or "FILE" for one without dashes.
  Option option(const std::string& names, std::string& value, const std::string& help);
  Option option(const std::string& names, std::vector<std::string>& value, const std::string& help);
  Option option(const std::string& names, double& value, const std::string& help);
  Option option(const std::string& names, int& value, const std::string& help);
  Option option(const std::string& names, std::uint64_t& value, const std::string& help);
  Option option(const std::string& names, std::optional<std::string>& value, const std::string& help);
  Option option(const std::string& names, std::optional<double>& value, const std::string& help);
  Option option(const std::string& names, std::optional<std::uint64_t>& value, const std::string& help);
  /// "!--no-ask" sets `value` to false.
  Option flag(const std::string& names, bool& value, const std::string& help);
  void footer(const std::string& text);
  [[nodiscard]] bool parsed() const;
  [[nodiscard]] std::string help() const;
  /// For completion: the options as they are typed, "--set" and "-s".
  [[nodiscard]] std::vector<std::string> option_names() const;
  /// What --help shows as the value of an option ("--set": "KEY=VALUE"), or for "" as the first argument without
  /// dashes, its name first ("experiment TEXT:{drop,stack}"). Empty: there is no such option, or it takes no value.
  [[nodiscard]] std::string value_type(const std::string& option) const;
  /// Parses the words as the program's line without its name. Prints nothing. @returns what is wrong, else nothing.
  [[nodiscard]] std::optional<std::string> complaint_about(const std::string& words);

 private:
  CLI::App* app_;
};

/// A program's whole command line.
class CommandLine {
 public:
  CommandLine(const std::string& name, const std::string& description);
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// The program itself, for options without a command.
  [[nodiscard]] Command root();
  Command add_command(const std::string& name, const std::string& description);
  void version(const std::string& text);
  void require_command();

  /// Prints help, version or what is wrong.
  /// @returns nothing when the program should go on, else its exit status: 0 after --help, 2 for wrong usage.
  [[nodiscard]] std::optional<int> parse(int argc, char** argv);

 private:
  std::unique_ptr<CLI::App> app_;
};

}  // namespace rtbus
