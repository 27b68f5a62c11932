// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Command lines of both programs: exit statuses, checks of options' values, whose errors are
// sentences ("must be a whole number from 0 to 1024, not 4096"), and messages for wrong usage.
#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "descriptor/base/error.h"

namespace pliant::cli {

// The only code that maps errors to exit statuses of both programs.
enum class ExitStatus {
  kDone = 0,
  kFailed = 1,
  kWrongUsage = 2,
  kSomeSkipped = 3,  // done, but some inputs were skipped; each was named with its reason
};

inline ExitStatus ToExitStatus(ErrorCode code) {
  return code == ErrorCode::kInvalidArgument ? ExitStatus::kWrongUsage : ExitStatus::kFailed;
}

// For CLI::App::failure_message(): what is wrong, and the --help to read.
std::string UsageError(const CLI::App* program, const CLI::Error& error);

// "; did you mean --top?", or empty if `word` resembles none of the names.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& names);

// The text of a library's error with flags instead of the fields of EngineOptions. Also with the
// flags of the command of `program` that was given: "min_score must be" becomes "--min-score must
// be".
std::string WithFlagNames(const Error& error, const CLI::App* program = nullptr);

// A whole number from `lowest` to `highest`.
CLI::Validator Between(long long lowest, long long highest);
// A number of at least `lowest`; from `lowest` to `highest`; above zero, and at most `highest`.
CLI::Validator AtLeast(double lowest);
CLI::Validator Within(double lowest, double highest);
CLI::Validator AboveZero(double highest = std::numeric_limits<double>::infinity());
// One of these words. The error suggests the most similar word.
CLI::Validator OneOf(std::vector<std::string> words);

// --help of both programs. To be set before commands are added, which inherit it.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;
};

template <typename Enum>
using Choices = std::vector<std::pair<std::string, Enum>>;

template <typename Enum>
std::vector<std::string> WordsOf(const Choices<Enum>& choices) {
  std::vector<std::string> words;
  for (const auto& [word, meaning] : choices) words.push_back(word);
  return words;
}

// An option whose values are the words in `choices`; --help lists them. `values`: one, an optional
// one, or a vector (several, comma-separated).
template <typename Enum, typename Values>
CLI::Option* AddChoice(CLI::App& app, const std::string& name, Values& values,
                       const std::string& help, const Choices<Enum>& choices) {
  constexpr bool kSeveral = requires { values.push_back(Enum{}); };
  const auto read = [&values, choices](const std::vector<std::string>& given) {
    if constexpr (kSeveral) values.clear();
    for (const std::string& word : given) {
      for (const auto& [known, meaning] : choices) {
        if (word != known) continue;
        if constexpr (kSeveral) {
          values.push_back(meaning);
        } else {
          values = meaning;
        }
      }
    }
  };
  CLI::Option* option = app.add_option_function<std::vector<std::string>>(name, read, help);
  if constexpr (kSeveral) {
    option->delimiter(',')->allow_extra_args(false);
  } else {
    option->expected(1);
  }
  return option->check(OneOf(WordsOf(choices)))
      ->option_text(CLI::detail::join(WordsOf(choices), "|"));
}

}  // namespace pliant::cli
