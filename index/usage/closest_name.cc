// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/closest_name.h"

#include <algorithm>

namespace pliant::cli {
namespace {

std::size_t Errors(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t wrong = d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      d[i][j] = std::min({wrong, d[i - 1][j] + 1, d[i][j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

std::string WithoutDashes(const std::string& name) {
  return name.substr(std::min(name.find_first_not_of('-'), name.size()));
}

}  // namespace

std::string ClosestName(const std::string& word, const std::vector<std::string>& names) {
  constexpr std::size_t kLongest = 100;  // the table is the product of both lengths
  const std::string meant = WithoutDashes(word);
  std::string closest;
  if (meant.size() > kLongest) return closest;
  std::size_t most = std::max<std::size_t>(1, meant.size() / 3);
  for (const std::string& name : names) {
    const std::string known = WithoutDashes(name);
    const bool begins = meant.size() >= 3 && known.starts_with(meant);
    const std::size_t errors = begins ? 1 : Errors(meant, known);
    if (errors > most || errors >= known.size() || (errors == most && !closest.empty())) continue;
    closest = name;
    most = errors;
  }
  return closest;
}

std::string DidYouMean(const std::string& word, const std::vector<std::string>& names) {
  const std::string closest = ClosestName(word, names);
  return closest.empty() ? "" : "; did you mean " + closest + "?";
}

}  // namespace pliant::cli
