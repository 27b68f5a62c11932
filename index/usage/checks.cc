// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/checks.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "index/usage/usage_error.h"

namespace pliant::cli {
namespace {

template <typename Number>
std::optional<Number> Parse(const std::string& text) {
  Number value{};
  const char* end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stopped != end) return std::nullopt;
  return value;
}

std::string Short(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

CLI::Validator Number(const std::string& wanted, bool (*right)(double, double), double lowest) {
  return CLI::Validator(
      [wanted, right, lowest](std::string& text) {
        const std::optional<double> value = Parse<double>(text);
        if (value && std::isfinite(*value) && right(*value, lowest)) return std::string();
        return "must be " + wanted + ", not " + text;
      },
      "");
}

}  // namespace

CLI::Validator Between(long long lowest, long long highest) {
  const std::string from = std::to_string(lowest);
  const std::string to = std::to_string(highest);
  return CLI::Validator(
      [=](std::string& text) {
        const std::optional<long long> value = Parse<long long>(text);
        if (value && *value >= lowest && *value <= highest) return std::string();
        return "must be a whole number from " + from + " to " + to + ", not " + text;
      },
      from + " to " + to);
}

CLI::Validator AtLeast(double lowest) {
  return Number(
      Short(lowest) + " or more", [](double value, double least) { return value >= least; },
      lowest);
}

CLI::Validator AboveZero() {
  return Number("more than 0", [](double value, double least) { return value > least; }, 0);
}

CLI::Validator OneOf(std::vector<std::string> words) {
  return CLI::Validator(
      [words = std::move(words)](std::string& text) {
        std::string listed;
        for (std::size_t i = 0; i < words.size(); ++i) {
          if (words[i] == text) return std::string();
          if (i > 0) listed += i + 1 < words.size() ? ", " : " or ";
          listed += words[i];
        }
        return "must be " + listed + ", not " + text + DidYouMean(text, words);
      },
      "");
}

}  // namespace pliant::cli
