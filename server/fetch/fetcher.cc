// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/fetcher.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <regex>
#include <utility>

#include <fmt/format.h>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"
#include "descriptor/base/strings.h"
#include "server/fetch/address_kind.h"
#include "server/fetch/transfer.h"
#include "server/fetch/web_address.h"
#include "server/http/problem.h"

namespace pliant::server {
namespace {

constexpr int kLargestPort = 65535;

int PortOf(const std::string& scheme) { return scheme == "https" ? 443 : 80; }

using Clock = std::chrono::steady_clock;

constexpr int kOk = 200;
constexpr std::chrono::milliseconds kLookEvery{100};  // whether to stop
constexpr const char* kParameter = "image_url";

bool IsRedirection(int status) {
  return status == 301 || status == 302 || status == 303 || status == 307 || status == 308;
}

[[noreturn]] void ThrowFailed(const std::string& detail, const std::string& internal = {}) {
  Problem problem = ProblemError("fetch_failed", detail).Parameter(kParameter).problem();
  problem.internal = internal;
  throw ProblemError(std::move(problem));
}

[[noreturn]] void ThrowNotAllowed(const std::string& detail, const std::string& internal = {}) {
  Problem problem = ProblemError("fetch_host_not_allowed", detail).Parameter(kParameter).problem();
  problem.internal = internal;
  throw ProblemError(std::move(problem));
}

[[noreturn]] void ThrowStopping() {
  throw ProblemError("stopping", "The server is being stopped.");
}

// What came of a transfer that did not end with an answer.
[[noreturn]] void ThrowFailure(const TransferResult& result, const FetchOptions& options) {
  using End = TransferResult::End;
  const std::string& internal = result.internal;
  switch (result.end) {
    case End::kForbidden:
      ThrowNotAllowed("The host of image_url has no public address.", internal);
    case End::kUnknown:
      ThrowFailed("The name of the host of image_url cannot be resolved.", internal);
    case End::kUnreachable:
      ThrowFailed("The host of image_url cannot be reached.", internal);
    case End::kUntrusted:
      ThrowFailed("The host of image_url has no certificate that is trusted.", internal);
    case End::kTimeout:
      ThrowFailed(fmt::format("Fetching image_url took longer than {:g} s.",
                              std::chrono::duration<double>(options.timeout).count()),
                  internal);
    case End::kTooLarge:
      ThrowFailed(
          fmt::format("What is at image_url is larger than {}.", FormatBytes(options.max_bytes)),
          internal);
    case End::kStopped:
      ThrowStopping();
    case End::kBroken:
    case End::kAnswered:
      break;
  }
  ThrowFailed("The host of image_url gave no complete answer.", internal);
}

// Where a redirection leads. Never from https to http: others could then read and change it.
WebAddress Next(const WebAddress& address, const std::string& location) {
  const auto next = [&] {
    try {
      return address.Redirected(location);
    } catch (const Error&) {
      ThrowFailed("image_url is redirected to what is no address of an image.");
    }
  };
  WebAddress there = next();
  if (address.scheme() == "https" && there.scheme() == "http") {
    ThrowFailed("image_url is redirected from https to http.");
  }
  return there;
}

// An image keeps its place.
std::shared_ptr<const std::vector<std::uint8_t>> Held(std::vector<std::uint8_t> bytes,
                                                      std::shared_ptr<void> place) {
  using Both = std::pair<std::vector<std::uint8_t>, std::shared_ptr<void>>;
  const auto both = std::make_shared<const Both>(std::move(bytes), std::move(place));
  return {both, &both->first};
}

}  // namespace

FetchHosts::FetchHosts(const std::vector<std::string>& entries) {
  static const std::regex form(
      R"((\*|(?:\*\.)?[a-z0-9_](?:[a-z0-9_.\-]*[a-z0-9_])?|\[[0-9a-f:.]+\])(?::([0-9]{1,5}))?)");
  for (const std::string& text : entries) {
    std::smatch parts;
    const std::string lower = Lower(text);
    const bool fits = std::regex_match(lower, parts, form);
    const int port = fits && parts[2].matched ? std::stoi(parts[2]) : 0;
    if (!fits || port > kLargestPort || (parts[2].matched && port == 0)) {
      throw Error(ErrorCode::kInvalidArgument, "fetch_hosts_invalid",
                  "hosts to fetch from must be names like images.example.org, *.shop.example or "
                  "images.example.org:8443, with commas between, or *, not '" +
                      text + "'");
    }
    std::string host = CanonicalHost(parts[1]);
    if (host.starts_with("*.")) host.erase(0, 1);
    entries_.push_back({std::move(host), port});
  }
}

bool FetchHosts::AllowsAny() const {
  return std::any_of(entries_.begin(), entries_.end(),
                     [](const Entry& entry) { return entry.host == "*"; });
}

bool FetchHosts::Allows(const std::string& scheme, const std::string& host, int port) const {
  return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
    if (port != (entry.port == 0 ? PortOf(scheme) : entry.port)) return false;
    if (entry.host == "*") return true;
    if (entry.host.front() != '.') return entry.host == host;
    return host.size() > entry.host.size() && host.ends_with(entry.host);
  });
}

// Counts the images that are on their way or in use. Thread-safe; outlives the fetcher with them.
class Fetcher::Places : public std::enable_shared_from_this<Places> {
 public:
  explicit Places(int most) : most_(std::max(1, most)) {}

  // A place, free again when what is returned is gone. Throws ProblemError "busy" and "stopping".
  std::shared_ptr<void> Take(For whom, Clock::time_point until, const std::function<bool()>& stop) {
    const int most = whom == For::kJob ? std::max(1, most_ / 2) : most_;
    std::unique_lock lock(mutex_);
    while (!stopped_ && used_ >= most) {
      const bool patient = whom == For::kJob || (whom == For::kBatch && Clock::now() < until);
      if (!patient) {
        throw ProblemError("busy", "Too many images are being fetched. Try again shortly.")
            .RetryAfter(2);
      }
      if (stop && stop()) ThrowStopping();
      freed_.wait_for(lock, kLookEvery);
    }
    if (stopped_) ThrowStopping();
    ++used_;
    lock.unlock();
    return {static_cast<void*>(this), [self = shared_from_this()](void*) { self->Free(); }};
  }

  void Stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    freed_.notify_all();
  }

  bool stopped() const {
    const std::lock_guard lock(mutex_);
    return stopped_;
  }

 private:
  void Free() {
    const std::lock_guard lock(mutex_);
    --used_;
    freed_.notify_all();
  }

  const int most_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable freed_;
  int used_ = 0;
  bool stopped_ = false;
};

Fetcher::Fetcher(FetchOptions options)
    : options_(std::move(options)),
      hosts_(options_.hosts),
      places_(std::make_shared<Places>(options_.most_at_once)) {
  if (on()) PrepareTransfers();
}

Fetcher::~Fetcher() { Stop(); }

void Fetcher::Stop() { places_->Stop(); }

void Fetcher::RequireAllowed(const WebAddress& address, const char* what) const {
  if (hosts_.Allows(address.scheme(), address.host(), address.port())) return;
  ThrowNotAllowed(std::string("The server does not fetch images from ") + what +
                  " (--fetch-hosts).");
}

FetchedImage Fetcher::Fetch(const std::string& url, For whom, const std::function<bool()>& stop,
                            std::shared_ptr<void> place) {
  if (!on()) {
    throw ProblemError("fetch_off", "The server fetches no images (--fetch-hosts).")
        .Parameter(kParameter);
  }
  WebAddress address(url);
  FetchedImage image;
  image.source = address.Display();
  RequireAllowed(address, "this host and port");
  if (!place) place = places_->Take(whom, Clock::now() + options_.timeout, stop);
  image.place = place;
  TransferOptions how;
  how.deadline = Clock::now() + options_.timeout;
  how.max_bytes = options_.max_bytes;
  how.allow_private = options_.allow_private;
  how.user_agent = options_.user_agent;
  how.stop = [&] { return places_->stopped() || (stop && stop()); };
  how.ca_file = options_.ca_file;
  how.resolve = options_.resolve;
  for (int redirections = 0;; ++redirections) {
    TransferResult result = Transfer(address, how);
    if (result.end != TransferResult::End::kAnswered) ThrowFailure(result, options_);
    if (result.status == kOk) {
      image.bytes = Held(std::move(result.body), place);
      return image;
    }
    if (!IsRedirection(result.status) || result.location.empty()) {
      ThrowFailed(fmt::format("The host of image_url answered {}.", result.status));
    }
    if (redirections == kMostRedirections) {
      ThrowFailed(fmt::format("image_url is redirected more than {} times.", kMostRedirections));
    }
    address = Next(address, result.location);
    RequireAllowed(address, "the host and port that image_url is redirected to");
  }
}

}  // namespace pliant::server
