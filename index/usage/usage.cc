// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/usage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string_view>

#include <fmt/format.h>

#include "descriptor/base/strings.h"

namespace pliant::cli {
namespace {

// A value of type Number that `is_right` accepts. `wanted`: for the error; `shown`: in --help.
template <typename Number, typename Rule>
CLI::Validator NumberThat(Rule is_right, std::string wanted, std::string shown = "") {
  return CLI::Validator(
      [is_right, wanted](std::string& text) {
        const auto value = NumberOf<Number>(text);
        if (value && is_right(*value)) return std::string();
        return fmt::format("must be {}, not {}", wanted, text);
      },
      std::move(shown));
}

// Levenshtein's distance: wrong, missing and additional characters.
std::size_t TypingErrors(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({replaced, row[j] + 1, row[j + 1] + 1}));
    }
  }
  return row.back();
}

// What can follow: commands, or options if `word` begins with a dash.
std::vector<std::string> Names(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  if (word.starts_with('-')) {
    for (const CLI::Option* option : app.get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  } else {
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
    }
  }
  return names;
}

// `pliant db check` is three apps.
std::vector<const CLI::App*> CommandOf(const CLI::App* program) {
  std::vector<const CLI::App*> command = {program};
  while (!command.back()->get_subcommands().empty()) {
    command.push_back(command.back()->get_subcommands().front());
  }
  return command;
}

// "Could not convert: NAME = VALUE", as a sentence.
std::string NotConverted(const CLI::App& app, const std::string& text) {
  const std::size_t begin = text.find(": ") + 2;
  const std::size_t equals = text.find(" = ", begin);
  if (equals == std::string::npos) return text;
  const std::string name = text.substr(begin, equals - begin);
  const CLI::Option* option = app.get_option_no_throw(name);
  if (option == nullptr) return text;
  std::string wanted = option->get_type_name();  // of the project, such as X,Y,W,H
  if (wanted.starts_with("INT") || wanted.starts_with("UINT")) wanted = "a whole number";
  if (wanted.starts_with("FLOAT")) wanted = "a number";
  if (wanted == "BOOL") wanted = "true or false";
  return fmt::format("{}: must be {}, not {}", name, wanted, text.substr(equals + 3));
}

// "--max-ratio" for the field max_ratio, if it is an option of the command.
std::string FlagOf(const CLI::App& app, std::string field) {
  std::ranges::replace(field, '_', '-');
  field.insert(0, "--");
  return app.get_option_no_throw(field) == nullptr ? "" : field;
}

}  // namespace

std::string DidYouMean(const std::string& word, const std::vector<std::string>& names) {
  constexpr std::size_t kLongest = 100;  // the work grows with the product of both lengths
  if (word.size() > kLongest) return "";
  std::size_t fewest = (word.size() + 1) / 2 + 1;
  std::string closest;
  for (const std::string& name : names) {
    const std::size_t errors = TypingErrors(word, name);
    if (errors >= std::min(fewest, name.size())) continue;
    fewest = errors;
    closest = name;
  }
  return closest.empty() ? "" : "; did you mean " + closest + "?";
}

CLI::Validator Between(long long lowest, long long highest) {
  return NumberThat<long long>([=](long long value) { return value >= lowest && value <= highest; },
                               fmt::format("a whole number from {} to {}", lowest, highest),
                               fmt::format("{} to {}", lowest, highest));
}

CLI::Validator AtLeast(double lowest) {
  return NumberThat<double>(
      [lowest](double value) { return std::isfinite(value) && value >= lowest; },
      fmt::format("{} or more", lowest));
}

CLI::Validator Within(double lowest, double highest) {
  return NumberThat<double>([=](double value) { return value >= lowest && value <= highest; },
                            fmt::format("a number from {} to {}", lowest, highest));
}

CLI::Validator AboveZero(double highest) {
  return NumberThat<double>(
      [highest](double value) { return std::isfinite(value) && value > 0 && value <= highest; },
      std::isfinite(highest) ? fmt::format("more than 0, and at most {}", highest) : "more than 0");
}

CLI::Validator OneOf(std::vector<std::string> words) {
  return CLI::Validator(
      [words = std::move(words)](std::string& text) {
        if (std::find(words.begin(), words.end(), text) != words.end()) return std::string();
        std::string listed;
        for (std::size_t i = 0; i < words.size(); ++i) {
          if (i > 0) listed += i + 1 < words.size() ? ", " : " or ";
          listed += words[i];
        }
        return fmt::format("must be {}, not {}{}", listed, text, DidYouMean(text, words));
      },
      "");
}

std::string HelpFormatter::make_option_name(const CLI::Option* option, bool is_positional) const {
  const std::string name = Formatter::make_option_name(option, is_positional);
  return name.substr(0, name.find('{'));  // of a flag --no-x, with what it means
}

std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  std::string text = Formatter::make_option_opts(option);
  if (!option->get_option_text().empty()) return text;
  const auto rename = [&text](std::string_view type, std::string_view name) {
    if (text.starts_with(type)) text.replace(0, type.size(), name);
  };
  rename(" UINT", " N");
  rename(" INT", " N");
  rename(" FLOAT", " NUMBER");
  if (option->get_positional()) rename(" TEXT", "");  // its name says what it is
  return text;
}

std::string UsageError(const CLI::App* program, const CLI::Error& error) {
  const std::vector<const CLI::App*> command = CommandOf(program);
  const CLI::App* app = command.back();
  std::string path;
  for (const CLI::App* word : command) path += (path.empty() ? "" : " ") + word->get_name();
  std::string text = error.what();
  const std::vector<std::string> unknown = program->remaining(true);
  const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
  if (code == CLI::ExitCodes::ConversionError) {
    text = NotConverted(*app, text);
  } else if (code == CLI::ExitCodes::ArgumentMismatch && text.ends_with(" missing")) {
    text = text.substr(0, text.find(':')) + ": a value is missing";
  } else if (const std::size_t at = text.find(": At Most 1 required"); at != std::string::npos) {
    text = text.substr(0, at) + ": can be given only once";
  } else if (code == CLI::ExitCodes::ConfigError) {
    std::string name = text.substr(text.rfind(' ') + 1);
    name = "--" + name.substr(0, name.rfind(".++"));  // of a table
    constexpr std::string_view kUnknown = "INI was not able to parse ";
    if (text.starts_with(kUnknown)) {
      text.replace(0, kUnknown.size(), "the configuration file has an unknown setting: ");
    }
    std::ranges::replace_if(text, [](unsigned char c) { return c < ' ' || c > '~'; }, '?');
    text += DidYouMean(name, Names(*app, name));
  } else if (!unknown.empty() &&
             (code == CLI::ExitCodes::ExtrasError || code == CLI::ExitCodes::RequiredError)) {
    const std::string word = unknown.front().substr(0, unknown.front().find('='));
    text = path + " does not take " + word + DidYouMean(word, Names(*app, word));
  }
  return text + "\nRun " + path + " --help for more information.\n";
}

std::string WithFlagNames(const Error& error, const CLI::App* program) {
  struct FlagName {
    std::string_view reason, field, flag;  // `reason`: of the errors that name the field
  };
  static constexpr std::array<FlagName, 4> kNames = {
      {{"extraction_mismatch", "max_keypoints", "--max-keypoints"},
       {"extraction_mismatch", "max_side_px", "--max-side"},
       {"database_exists", "replace", "--replace"},
       {"originals_missing", "originals_dir", "--originals-dir"}}};
  std::string text = error.what();
  for (const FlagName& name : kNames) {
    const std::size_t at = text.find(fmt::format("with {} ", name.field));
    if (error.reason() != name.reason || at == std::string::npos) continue;
    text.replace(at + 5, name.field.size(), name.flag);
  }
  if (program == nullptr || error.code() != ErrorCode::kInvalidArgument) return text;
  const CLI::App& app = *CommandOf(program).back();
  // The text begins with the field, or else the reason does: "filter_invalid".
  const std::size_t end =
      std::min(text.find_first_not_of("abcdefghijklmnopqrstuvwxyz_"), text.size());
  if (const std::string flag = FlagOf(app, text.substr(0, end));
      !flag.empty() && text[end] != '.') {
    return flag + text.substr(end);
  }
  const std::string& reason = error.reason();
  const std::string flag = FlagOf(app, reason.substr(0, reason.rfind('_')));
  return flag.empty() ? text : flag + ": " + text;
}

}  // namespace pliant::cli
