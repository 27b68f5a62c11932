// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Checks of options' values, whose errors are sentences: "must be 0 to 1024, not 4096".
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

namespace pliant::cli {

// A whole number from `lowest` to `highest`.
CLI::Validator Between(long long lowest, long long highest);
// A number of at least `lowest`; one above zero.
CLI::Validator AtLeast(double lowest);
CLI::Validator AboveZero();
// One of these words. The error names the one that was probably meant.
CLI::Validator OneOf(std::vector<std::string> words);

template <typename Enum>
using Choices = std::vector<std::pair<std::string, Enum>>;

// "object|image"
template <typename Enum>
std::string Listed(const Choices<Enum>& choices) {
  std::string listed;
  for (const auto& [word, meaning] : choices) listed += (listed.empty() ? "" : "|") + word;
  return listed;
}

template <typename Enum>
CLI::Validator OneOfChoices(const Choices<Enum>& choices) {
  std::vector<std::string> words;
  for (const auto& [word, meaning] : choices) words.push_back(word);
  return OneOf(std::move(words));
}

template <typename Enum>
Enum MeaningOf(const std::string& given, const Choices<Enum>& choices) {
  for (const auto& [word, meaning] : choices) {
    if (word == given) return meaning;
  }
  throw CLI::ValidationError(given);  // OneOf was asked before
}

// An option whose values are the names in `choices`; --help lists them. `Value`: Enum, or optional.
template <typename Enum, typename Value>
CLI::Option* AddChoice(CLI::App& app, const std::string& name, Value& value,
                       const std::string& help, const Choices<Enum>& choices) {
  return app
      .add_option_function<std::string>(
          name, [&value, choices](const std::string& given) { value = MeaningOf(given, choices); },
          help)
      ->check(OneOfChoices(choices))
      ->option_text(Listed(choices));
}

// The same with several values, separated by commas.
template <typename Enum>
CLI::Option* AddChoices(CLI::App& app, const std::string& name, std::vector<Enum>& values,
                        const std::string& help, const Choices<Enum>& choices) {
  return app
      .add_option_function<std::vector<std::string>>(
          name,
          [&values, choices](const std::vector<std::string>& given) {
            values.clear();
            for (const std::string& word : given) values.push_back(MeaningOf(word, choices));
          },
          help)
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(OneOfChoices(choices))
      ->option_text(Listed(choices));
}

}  // namespace pliant::cli
