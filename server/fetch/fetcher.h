// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images that a client names by their address on the web: the server fetches them from the hosts
// that its operator allows.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace pliant::server {

// The operator's list of hosts to fetch from. Immutable and thread-safe.
class FetchHosts {
 public:
  // Each entry is "host", "*.suffix" (all names below it, not itself) or "*" (any), followed by
  // ":port" for another port than 80 (http) and 443 (https); "[2001:db8::1]" for an IPv6 address.
  // Throws Error kInvalidArgument "fetch_hosts_invalid" naming the entry.
  explicit FetchHosts(const std::vector<std::string>& entries);

  bool empty() const { return entries_.empty(); }
  bool AllowsAny() const;  // there is a "*"
  // `scheme` is "http" or "https"; `host` in lower case, an IPv6 address in brackets.
  bool Allows(const std::string& scheme, const std::string& host, int port) const;

 private:
  struct Entry {
    std::string host;  // with a dot before it: a suffix; "*": any
    int port = 0;      // 0 = the scheme's own
  };
  std::vector<Entry> entries_;
};

class WebAddress;

struct FetchOptions {
  std::vector<std::string> hosts = {};        // see FetchHosts; empty = nothing is fetched
  bool allow_private = false;                 // of these hosts also loopback and private addresses
  std::chrono::milliseconds timeout{10'000};  // of one image, with all redirections
  std::size_t max_bytes = 32 * 1024 * 1024;   // of an image
  int most_at_once = 16;                      // images in transfer or in use
  std::string user_agent = "Pliant";
  std::string ca_file = {};               // PEM; empty = the system's certificates
  std::vector<std::string> resolve = {};  // "host:port:address" instead of the system's resolver
};

struct FetchedImage {
  // As long as these are held, the image counts among FetchOptions::most_at_once.
  std::shared_ptr<const std::vector<std::uint8_t>> bytes;
  std::string source;  // its address without query and fragment
  std::shared_ptr<void> place = {};
};

// Thread-safe. Its results can outlive it.
class Fetcher {
 public:
  static constexpr int kMostRedirections = 3;

  // Throws Error kInvalidArgument "fetch_hosts_invalid".
  explicit Fetcher(FetchOptions options);
  ~Fetcher();
  Fetcher(const Fetcher&) = delete;
  Fetcher& operator=(const Fetcher&) = delete;

  bool on() const { return !hosts_.empty(); }

  // What happens when all slots are in use.
  enum class For {
    kRequest,  // refused at once: it holds a thread that serves requests
    kBatch,    // waits for FetchOptions::timeout
    kJob,      // waits until `stop`, and leaves half of the slots to the others
  };
  // Throws ProblemError: "fetch_off"; "fetch_host_not_allowed", also for a redirection to such a
  // host, and for a host without an address that the server can connect to; "fetch_failed", which
  // says why; "busy"; "stopping" when the server stops or `stop` says so. Throws Error
  // "image_url_invalid". `place`: the slot of another image of the same request, to share; null = a
  // new one.
  //
  // The network address is checked when the socket is made, after all resolving: no name can mean
  // another address than the one that was allowed. No cookies, proxies, keys or passwords of the
  // environment are used, nothing is decompressed, certificates are verified.
  FetchedImage Fetch(const std::string& url, For whom = For::kRequest,
                     const std::function<bool()>& stop = {}, std::shared_ptr<void> place = {});

  // Ends running transfers, within a second, and refuses new ones.
  void Stop();

 private:
  class Slots;

  void RequireAllowed(const WebAddress& address, const char* what) const;

  const FetchOptions options_;
  const FetchHosts hosts_;
  const std::shared_ptr<Slots> slots_;
};

}  // namespace pliant::server
