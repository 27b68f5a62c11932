// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses on the web that clients name: the first line is one, the second where it redirects to.
#include <algorithm>

#include "descriptor/base/error.h"
#include "server/fetch/web_address.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Require;
using pliant::server::WebAddress;

// Whatever is refused is refused as the client's mistake.
template <typename Work>
void Takes(Work&& work) {
  try {
    work();
  } catch (const pliant::Error& error) {
    Require(error.code() == pliant::ErrorCode::kInvalidArgument, "the address is to blame");
  }
}

void Check(const WebAddress& address) {
  Require(address.scheme() == "http" || address.scheme() == "https", "the scheme is of the web");
  const std::string& host = address.host();
  Require(!host.empty() && host == pliant::server::CanonicalHost(host), "hosts have one form");
  Require(host.find_first_of("@/?#\\%, \t\r\n") == std::string::npos &&
              std::all_of(host.begin(), host.end(), [](unsigned char c) { return c < 0x80; }),
          "a host is a name and nothing else");
  Require(address.port() >= 0 && address.port() <= 65535, "a port is one");
  const std::string display = address.Display();
  Require(display.find_first_of("?#") == std::string::npos, "nothing secret is shown");
  const WebAddress again(display);
  Require(
      again.scheme() == address.scheme() && again.host() == host && again.port() == address.port(),
      "what is shown is where it leads");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(pliant::fuzz::TextOf({data, size}));
  const std::size_t end = std::min(text.find('\n'), text.size());
  Takes([&] {
    const WebAddress address(text.substr(0, end));
    Check(address);
    Takes([&] { Check(address.Redirected(text.substr(std::min(end + 1, text.size())))); });
  });
  return 0;
}
