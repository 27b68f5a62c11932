// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/peers/peer_layout.h"

#include <algorithm>
#include <fstream>

#include <CLI/CLI.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"

namespace pliant::server {

PeerLayout ReadPeerLayout(const std::filesystem::path& file) {
  const auto fail = [&](const std::string& why) {
    throw Error(ErrorCode::kInvalidArgument, "peers_invalid",
                "the file of --peers, " + file.string() + ", " + why);
  };
  std::ifstream in(file);
  if (!in.is_open()) fail("cannot be read");
  PeerLayout layout;
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(in);
  } catch (const CLI::Error& error) {
    fail(std::string("is no TOML: ") + error.what());
  }
  for (const CLI::ConfigItem& item : items) {
    if (item.name == "++" || item.name == "--") continue;  // begin and end of a section
    const std::string value = item.inputs.size() == 1 ? item.inputs.front() : "";
    if (item.parents.empty() && item.name == "key") {
      layout.key = value;
    } else if (item.parents.empty() && item.name == "timeout_ms") {
      const auto ms = NumberOf<int>(value);
      if (!ms || *ms < 1 || *ms > 600'000) fail("has a timeout_ms that is not 1 to 600000");
      layout.timeout = std::chrono::milliseconds(*ms);
    } else if (item.parents == std::vector<std::string>{"parts"}) {
      if (item.name != std::to_string(layout.parts.size() + 1)) {
        fail("does not list the parts 1, 2, ... in order");
      }
      layout.parts.push_back(item.inputs);
      for (std::string& address : layout.parts.back()) {
        if (address.ends_with('/')) address.pop_back();
        if (!address.starts_with("http://") && !address.starts_with("https://")) {
          fail("has the address '" + address + "', which is not http:// or https://");
        }
      }
    } else {
      fail("has an unknown entry " + item.fullname());
    }
  }
  const auto empty = [](const auto& part) { return part.empty(); };
  if (layout.parts.empty() || std::ranges::any_of(layout.parts, empty)) {
    fail("lists no servers for some part");
  }
  return layout;
}

}  // namespace pliant::server
