// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images that a client names by their address on the web, fetched by the server where its
// operator allows the host.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace pliant::server {

// The operator's list of the hosts that images may be fetched from.

// Immutable and thread-safe.
class FetchHosts {
 public:
  // Each "host", "*.suffix" (all names below it, not itself) or "*" (any), with ":port" behind it
  // for another port than 80 (http) and 443 (https); "[2001:db8::1]" for an IPv6 address. Throws
  // Error kInvalidArgument "fetch_hosts_invalid" naming the entry.
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
  int most_at_once = 16;                      // images on their way or in use
  std::string user_agent = "Pliant";
  std::string ca_file = {};               // PEM; empty = the system's certificates
  std::vector<std::string> resolve = {};  // "host:port:address" in place of the system's resolver
};

struct FetchedImage {
  // As long as these are held, the image counts among FetchOptions::most_at_once.
  std::shared_ptr<const std::vector<std::uint8_t>> bytes;
  std::string source;                // its address without query and fragment
  std::shared_ptr<void> place = {};  // which it takes
};

// Thread-safe. What it returns may outlive it.
class Fetcher {
 public:
  static constexpr int kMostRedirections = 3;

  // Throws Error kInvalidArgument "fetch_hosts_invalid".
  explicit Fetcher(FetchOptions options);
  ~Fetcher();
  Fetcher(const Fetcher&) = delete;
  Fetcher& operator=(const Fetcher&) = delete;

  bool on() const { return !hosts_.empty(); }

  // Who asks, when all places are taken.
  enum class For {
    kRequest,  // is refused at once: it holds a thread that serves requests
    kBatch,    // waits as long as one image may take
    kJob,      // waits until `stop`, and leaves half of the places to the others
  };
  // Throws ProblemError: "fetch_off"; "fetch_host_not_allowed", also for a redirection to such a
  // host, and for a host that has only addresses that may not be connected to; "fetch_failed",
  // which says why; "busy"; "stopping" when the server stops or `stop` says so. Throws Error
  // "image_url_invalid".
  // `place`: of another image of the same request, to be shared with it; null = one of its own.
  FetchedImage Fetch(const std::string& url, For whom = For::kRequest,
                     const std::function<bool()>& stop = {}, std::shared_ptr<void> place = {});

  // Ends what runs, within a second, and refuses all that comes.
  void Stop();

 private:
  class Places;

  void RequireAllowed(const WebAddress& address, const char* what) const;

  const FetchOptions options_;
  const FetchHosts hosts_;
  const std::shared_ptr<Places> places_;
};

}  // namespace pliant::server
