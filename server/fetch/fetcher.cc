// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/fetcher.h"

#include <algorithm>
#include <array>
#include <condition_variable>
#include <mutex>
#include <new>
#include <regex>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <curl/curl.h>
#include <fmt/format.h>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"
#include "descriptor/base/strings.h"
#include "server/fetch/web_address.h"
#include "server/http/problem.h"

namespace pliant::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kLargestPort = 65535;
constexpr int kOk = 200;
constexpr std::size_t kMaxHeaderBytes = 64 * 1024;
constexpr std::size_t kMaxLocationBytes = 4096;
constexpr std::chrono::milliseconds kLookEvery{100};  // whether to stop
constexpr const char* kParameter = "image_url";

bool IsRedirection(long status) {
  return status == 301 || status == 302 || status == 303 || status == 307 || status == 308;
}

[[noreturn]] void ThrowFailed(const std::string& detail, const std::string& internal = {}) {
  throw ProblemError("fetch_failed", detail, {.parameter = kParameter, .internal = internal});
}

[[noreturn]] void ThrowNotAllowed(const std::string& detail, const std::string& internal = {}) {
  throw ProblemError("fetch_host_not_allowed", detail,
                     {.parameter = kParameter, .internal = internal});
}

[[noreturn]] void ThrowStopping() { throw ProblemError("stopping", "The server is stopping."); }

// libcurl gives nullptr only when memory runs out.
template <typename T>
T* Required(T* made) {
  if (made == nullptr) throw std::bad_alloc();
  return made;
}

using List = std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)>;

List ListOf(const std::vector<std::string>& items) {
  List list(nullptr, curl_slist_free_all);
  for (const std::string& item : items) {
    curl_slist* longer = Required(curl_slist_append(list.get(), item.c_str()));
    if (!list) list.reset(longer);
  }
  return list;
}

// One request, without its redirections, and what the library's callbacks work on. C calls them:
// they throw nothing.
struct Transfer {
  const FetchOptions& options;
  const std::function<bool()>& stop;  // asked about every second; true ends it
  CURL* handle = nullptr;
  long status = 0;
  std::string location = {};            // as sent; of a redirection
  std::vector<std::uint8_t> body = {};  // when the status is 200
  std::size_t header_bytes = 0;
  bool forbidden = false;  // an address was
  bool too_large = false;

  bool Permits(const sockaddr* address) const {
    const AddressKind kind = KindOf(address);
    return kind == AddressKind::kPublic || (kind == AddressKind::kPrivate && options.allow_private);
  }
};

curl_socket_t OnSocket(void* transfer, curlsocktype, curl_sockaddr* address) {
  if (!static_cast<Transfer*>(transfer)->Permits(&address->addr)) {
    static_cast<Transfer*>(transfer)->forbidden = true;
    return CURL_SOCKET_BAD;
  }
  return ::socket(address->family, address->socktype | SOCK_CLOEXEC, address->protocol);
}

std::size_t OnHeader(const char* data, std::size_t, std::size_t size, void* user) noexcept {
  Transfer& transfer = *static_cast<Transfer*>(user);
  transfer.header_bytes += size;
  if (transfer.header_bytes > kMaxHeaderBytes) return 0;
  constexpr std::string_view kLocation = "location:";
  std::string_view line(data, size);
  if (line.starts_with("HTTP/")) transfer.location.clear();  // of an answer before: a 1xx
  if (!EqualsIgnoringCase(line.substr(0, kLocation.size()), kLocation) ||
      !transfer.location.empty()) {
    return size;
  }
  line.remove_prefix(kLocation.size());
  while (line.ends_with('\n') || line.ends_with('\r')) line.remove_suffix(1);
  transfer.location = Trimmed(line).substr(0, kMaxLocationBytes);
  return size;
}

std::size_t OnBody(const char* data, std::size_t, std::size_t size, void* user) noexcept {
  Transfer& transfer = *static_cast<Transfer*>(user);
  curl_easy_getinfo(transfer.handle, CURLINFO_RESPONSE_CODE, &transfer.status);
  if (transfer.status != kOk) return 0;  // nobody wants it
  transfer.too_large = transfer.body.size() + size > transfer.options.max_bytes;
  if (transfer.too_large) return 0;
  transfer.body.insert(transfer.body.end(), data, data + size);
  return size;
}

int OnProgress(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return static_cast<Transfer*>(user)->stop() ? 1 : 0;
}

template <typename T>
void Set(CURL* handle, CURLoption option, T value) {
  const CURLcode code = curl_easy_setopt(handle, option, value);
  if (code != CURLE_OK) throw std::runtime_error(curl_easy_strerror(code));
}

void SetOptions(Transfer& transfer, const WebAddress& address, Clock::time_point deadline) {
  CURL* handle = transfer.handle;
  const FetchOptions& options = transfer.options;
  Set(handle, CURLOPT_CURLU, address.parts());
  Set(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  Set(handle, CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
  Set(handle, CURLOPT_FOLLOWLOCATION, 0L);
  Set(handle, CURLOPT_USERAGENT, options.user_agent.c_str());
  Set(handle, CURLOPT_HTTP_CONTENT_DECODING, 0L);
  // Proxies and passwords of the environment are for other programs.
  Set(handle, CURLOPT_PROXY, "");
  Set(handle, CURLOPT_NOPROXY, "*");
  Set(handle, CURLOPT_NETRC, static_cast<long>(CURL_NETRC_IGNORED));
  Set(handle, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  Set(handle, CURLOPT_SSL_VERIFYPEER, 1L);
  Set(handle, CURLOPT_SSL_VERIFYHOST, 2L);
  if (!options.ca_file.empty()) Set(handle, CURLOPT_CAINFO, options.ca_file.c_str());
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
  const long most_ms = static_cast<long>(std::max<long long>(1, left.count()));
  Set(handle, CURLOPT_NOSIGNAL, 1L);
  Set(handle, CURLOPT_TIMEOUT_MS, most_ms);
  Set(handle, CURLOPT_CONNECTTIMEOUT_MS, most_ms);
  Set(handle, CURLOPT_QUICK_EXIT, 1L);  // does not wait for a slow resolver
  Set(handle, CURLOPT_MAXFILESIZE_LARGE, static_cast<curl_off_t>(options.max_bytes));
  Set(handle, CURLOPT_FRESH_CONNECT, 1L);
  Set(handle, CURLOPT_FORBID_REUSE, 1L);
  Set(handle, CURLOPT_NOPROGRESS, 0L);
  Set(handle, CURLOPT_OPENSOCKETFUNCTION, OnSocket);
  Set(handle, CURLOPT_OPENSOCKETDATA, &transfer);
  Set(handle, CURLOPT_HEADERFUNCTION, OnHeader);
  Set(handle, CURLOPT_HEADERDATA, &transfer);
  Set(handle, CURLOPT_WRITEFUNCTION, OnBody);
  Set(handle, CURLOPT_WRITEDATA, &transfer);
  Set(handle, CURLOPT_XFERINFOFUNCTION, OnProgress);
  Set(handle, CURLOPT_XFERINFODATA, &transfer);
}

// Throws unless the host has answered, with any status.
void RequireAnswer(CURLcode code, const Transfer& transfer, const std::string& internal) {
  // OnBody reads no other answer than kOk, however long it says it is.
  const bool unread = code == CURLE_WRITE_ERROR || code == CURLE_FILESIZE_EXCEEDED;
  if (code == CURLE_OK || (unread && transfer.status != 0 && transfer.status != kOk)) return;
  if (transfer.too_large || code == CURLE_FILESIZE_EXCEEDED) {
    ThrowFailed(fmt::format("The file at image_url is larger than {}.",
                            FormatBytes(transfer.options.max_bytes)),
                internal);
  }
  switch (code) {
    case CURLE_OPERATION_TIMEDOUT:
      ThrowFailed(fmt::format("Fetching image_url took longer than {:g} s.",
                              std::chrono::duration<double>(transfer.options.timeout).count()),
                  internal);
    case CURLE_ABORTED_BY_CALLBACK:
      ThrowStopping();
    case CURLE_COULDNT_RESOLVE_HOST:
      ThrowFailed("The host name in image_url cannot be resolved.", internal);
    case CURLE_COULDNT_CONNECT:
      if (transfer.forbidden) {
        ThrowNotAllowed("The host of image_url has no public address.", internal);
      }
      ThrowFailed("The host of image_url cannot be reached.", internal);
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
    case CURLE_SSL_ISSUER_ERROR:
    case CURLE_SSL_CONNECT_ERROR:
      ThrowFailed("The TLS certificate of the host of image_url is not trusted.", internal);
    default:
      ThrowFailed("The host of image_url did not send a complete answer.", internal);
  }
}

void Run(Transfer& transfer, const WebAddress& address, Clock::time_point deadline) {
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle(Required(curl_easy_init()),
                                                                   curl_easy_cleanup);
  transfer.handle = handle.get();
  const List headers = ListOf({"Accept: image/*", "Accept-Encoding: identity"});
  const List resolve = ListOf(transfer.options.resolve);
  std::array<char, CURL_ERROR_SIZE> text{};
  SetOptions(transfer, address, deadline);
  Set(handle.get(), CURLOPT_HTTPHEADER, headers.get());
  if (resolve) Set(handle.get(), CURLOPT_RESOLVE, resolve.get());
  Set(handle.get(), CURLOPT_ERRORBUFFER, text.data());
  const CURLcode code = curl_easy_perform(handle.get());
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &transfer.status);
  RequireAnswer(code, transfer, text.front() != '\0' ? text.data() : curl_easy_strerror(code));
}

// Where a redirection leads. Never from https to http: others could then read and change it.
WebAddress Next(const WebAddress& address, const std::string& location) {
  const auto next = [&] {
    try {
      return address.Redirected(location);
    } catch (const Error&) {
      ThrowFailed("image_url redirects to an invalid address.");
    }
  };
  WebAddress there = next();
  if (address.scheme() == "https" && there.scheme() == "http") {
    ThrowFailed("image_url redirects from https to http, which is not allowed.");
  }
  return there;
}

// An image keeps its slot.
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
                  "use comma-separated hosts like images.example.org, *.shop.example or "
                  "images.example.org:8443, or *, not '" +
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
    const int usual = scheme == "https" ? 443 : 80;
    if (port != (entry.port == 0 ? usual : entry.port)) return false;
    if (entry.host == "*") return true;
    if (entry.host.front() != '.') return entry.host == host;
    return host.size() > entry.host.size() && host.ends_with(entry.host);
  });
}

// Counts the images that are on their way or in use. Thread-safe; outlives the fetcher with them.
class Fetcher::Slots : public std::enable_shared_from_this<Slots> {
 public:
  explicit Slots(int most) : most_(std::max(1, most)) {}

  // A slot, held until the result is destroyed. Throws ProblemError "busy" and "stopping".
  std::shared_ptr<void> Take(For whom, Clock::time_point until, const std::function<bool()>& stop) {
    const int most = whom == For::kJob ? std::max(1, most_ / 2) : most_;
    std::unique_lock lock(mutex_);
    while (!stopped_ && used_ >= most) {
      const bool patient = whom == For::kJob || (whom == For::kBatch && Clock::now() < until);
      if (!patient) {
        throw ProblemError("busy", "Too many images are being fetched. Try again shortly.",
                           {.retry_after_s = 2});
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
      slots_(std::make_shared<Slots>(options_.most_at_once)) {
  static std::once_flag once;
  if (on()) std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
}

Fetcher::~Fetcher() { Stop(); }

void Fetcher::Stop() { slots_->Stop(); }

void Fetcher::RequireAllowed(const WebAddress& address, const char* what) const {
  if (hosts_.Allows(address.scheme(), address.host(), address.port())) return;
  ThrowNotAllowed(
      fmt::format("The server does not fetch from {}. The operator can set --fetch-hosts.", what));
}

FetchedImage Fetcher::Fetch(const std::string& url, For whom, const std::function<bool()>& stop,
                            std::shared_ptr<void> place) {
  if (!on()) {
    throw ProblemError("fetch_off",
                       "The server does not fetch images. The operator can set --fetch-hosts.",
                       {.parameter = kParameter});
  }
  WebAddress address(url);
  FetchedImage image;
  image.source = address.Display();
  RequireAllowed(address, "this host and port");
  if (!place) place = slots_->Take(whom, Clock::now() + options_.timeout, stop);
  image.place = place;
  const auto deadline = Clock::now() + options_.timeout;
  const std::function<bool()> ends = [&] { return slots_->stopped() || (stop && stop()); };
  for (int redirections = 0;; ++redirections) {
    Transfer transfer{options_, ends};
    Run(transfer, address, deadline);
    if (transfer.status == kOk) {
      image.bytes = Held(std::move(transfer.body), place);
      return image;
    }
    if (!IsRedirection(transfer.status) || transfer.location.empty()) {
      ThrowFailed(fmt::format("The host of image_url answered with status {}.", transfer.status));
    }
    if (redirections == kMostRedirections) {
      ThrowFailed(fmt::format("image_url redirects more than {} times.", kMostRedirections));
    }
    address = Next(address, transfer.location);
    RequireAllowed(address, "the host and port that image_url redirects to");
  }
}

}  // namespace pliant::server
