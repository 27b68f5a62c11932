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

CLI::Validator AboveZero() {
  return NumberThat<double>([](double value) { return std::isfinite(value) && value > 0; },
                            "more than 0");
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

std::string UsageError(const CLI::App* program, const CLI::Error& error) {
  const CLI::App* app = program;  // then the innermost command: `pliant db check` is three apps
  std::string path = app->get_name();
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    path += " " + app->get_name();
  }
  std::string text = error.what();
  const std::vector<std::string> unknown = program->remaining(true);
  const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
  if (code == CLI::ExitCodes::ConfigError) {
    std::string name = text.substr(text.rfind(' ') + 1);
    name = "--" + name.substr(0, name.rfind(".++"));  // of a table
    text += DidYouMean(name, Names(*app, name));
  } else if (!unknown.empty() &&
             (code == CLI::ExitCodes::ExtrasError || code == CLI::ExitCodes::RequiredError)) {
    const std::string word = unknown.front().substr(0, unknown.front().find('='));
    text = path + " does not take " + word + DidYouMean(word, Names(*app, word));
  }
  return text + "\nRun " + path + " --help for more information.\n";
}

std::string WithFlagNames(const Error& error) {
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
  return text;
}

}  // namespace pliant::cli
