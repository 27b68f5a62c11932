// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/accept.h"

#include "descriptor/base/strings.h"

namespace pliant::server {
namespace {

// "0", "0.5", "1.000" in thousandths; -1 = no q-value.
int ThousandthsOf(std::string_view text) {
  if (text.empty() || text.size() > 5 || (text[0] != '0' && text[0] != '1')) return -1;
  if (text.size() > 1 && text[1] != '.') return -1;
  int value = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    if (i == 1) continue;
    const char digit = i < text.size() ? text[i] : '0';
    if (digit < '0' || digit > '9') return -1;
    value = value * 10 + (digit - '0');
  }
  return value > 1000 ? -1 : value;
}

}  // namespace

std::map<std::string, int> WeightsOf(std::string_view list) {
  std::map<std::string, int> weights;
  for (const std::string& entry : Split(list, ',')) {
    const std::string_view text = entry;
    const std::size_t semicolon = text.find(';');
    const std::string name = Lower(Trimmed(text.substr(0, semicolon)));
    int weight = 1000;
    if (semicolon != std::string_view::npos) {
      const std::string q = Lower(Trimmed(text.substr(semicolon + 1)));
      weight = q.starts_with("q=") ? ThousandthsOf(std::string_view(q).substr(2)) : -1;
    }
    if (weight >= 0 && !name.empty()) weights.emplace(name, weight);
  }
  return weights;
}

}  // namespace pliant::server
