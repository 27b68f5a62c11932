// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/transfer.h"

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string_view>

#include <curl/curl.h>

#include "descriptor/base/strings.h"
#include "server/fetch/address_kind.h"

namespace pliant::server {

namespace {

using End = TransferResult::End;

constexpr std::size_t kMaxHeaderBytes = 64 * 1024;
constexpr std::size_t kMaxLocationBytes = 4096;
constexpr long kOk = 200;

// libcurl gives nullptr only when memory runs out.
template <typename T>
T* Required(T* made) {
  if (made == nullptr) throw std::bad_alloc();
  return made;
}

struct List {
  List() = default;
  ~List() { curl_slist_free_all(items); }
  List(const List&) = delete;
  List& operator=(const List&) = delete;
  void Add(const std::string& text) { items = Required(curl_slist_append(items, text.c_str())); }
  curl_slist* items = nullptr;
};

// What the library's callbacks work on. C calls them: they throw nothing.
struct Run {
  const TransferOptions& options;
  CURL* handle = nullptr;
  TransferResult result = {};
  std::size_t header_bytes = 0;
  bool forbidden = false;  // an address was
  bool too_large = false;

  bool Permits(const sockaddr* address) const {
    const AddressKind kind = KindOf(address);
    return kind == AddressKind::kPublic || (kind == AddressKind::kPrivate && options.allow_private);
  }
};

curl_socket_t OnSocket(void* run, curlsocktype, curl_sockaddr* address) {
  if (!static_cast<Run*>(run)->Permits(&address->addr)) {
    static_cast<Run*>(run)->forbidden = true;
    return CURL_SOCKET_BAD;
  }
  return ::socket(address->family, address->socktype | SOCK_CLOEXEC, address->protocol);
}

bool StartsWithName(std::string_view line, std::string_view name) {
  return line.size() > name.size() && line[name.size()] == ':' &&
         EqualsIgnoringCase(line.substr(0, name.size()), name);
}

std::size_t OnHeader(const char* data, std::size_t, std::size_t size, void* user) noexcept {
  Run& run = *static_cast<Run*>(user);
  run.header_bytes += size;
  if (run.header_bytes > kMaxHeaderBytes) return 0;
  constexpr std::string_view kLocation = "location";
  std::string_view line(data, size);
  if (line.starts_with("HTTP/")) run.result.location.clear();  // of an answer before: a 1xx
  if (!StartsWithName(line, kLocation) || !run.result.location.empty()) return size;
  line.remove_prefix(kLocation.size() + 1);
  while (line.ends_with('\n') || line.ends_with('\r')) line.remove_suffix(1);
  run.result.location = Trimmed(line).substr(0, kMaxLocationBytes);
  return size;
}

std::size_t OnBody(const char* data, std::size_t, std::size_t size, void* user) noexcept {
  Run& run = *static_cast<Run*>(user);
  long status = 0;
  curl_easy_getinfo(run.handle, CURLINFO_RESPONSE_CODE, &status);
  if (status != kOk) return 0;  // nobody wants it
  std::vector<std::uint8_t>& body = run.result.body;
  run.too_large = body.size() + size > run.options.max_bytes;
  if (run.too_large) return 0;
  body.insert(body.end(), data, data + size);
  return size;
}

int OnProgress(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return static_cast<Run*>(user)->options.stop() ? 1 : 0;
}

template <typename T>
void Set(CURL* handle, CURLoption option, T value) {
  const CURLcode code = curl_easy_setopt(handle, option, value);
  if (code != CURLE_OK) throw std::runtime_error(curl_easy_strerror(code));
}

void SetRequest(CURL* handle, const WebAddress& address, const TransferOptions& options) {
  Set(handle, CURLOPT_CURLU, address.parts());
  Set(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  Set(handle, CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
  Set(handle, CURLOPT_FOLLOWLOCATION, 0L);
  Set(handle, CURLOPT_USERAGENT, options.user_agent.c_str());
  Set(handle, CURLOPT_HTTP_CONTENT_DECODING, 0L);
  // What the environment says is for other programs.
  Set(handle, CURLOPT_PROXY, "");
  Set(handle, CURLOPT_NOPROXY, "*");
  Set(handle, CURLOPT_NETRC, static_cast<long>(CURL_NETRC_IGNORED));
  Set(handle, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  Set(handle, CURLOPT_SSL_VERIFYPEER, 1L);
  Set(handle, CURLOPT_SSL_VERIFYHOST, 2L);
  if (!options.ca_file.empty()) Set(handle, CURLOPT_CAINFO, options.ca_file.c_str());
}

void SetLimits(CURL* handle, const TransferOptions& options) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(options.deadline -
                                                                 std::chrono::steady_clock::now());
  const long most_ms = static_cast<long>(std::max<long long>(1, left.count()));
  Set(handle, CURLOPT_NOSIGNAL, 1L);
  Set(handle, CURLOPT_TIMEOUT_MS, most_ms);
  Set(handle, CURLOPT_CONNECTTIMEOUT_MS, most_ms);
  Set(handle, CURLOPT_QUICK_EXIT, 1L);  // does not wait for a resolver that is late
  Set(handle, CURLOPT_MAXFILESIZE_LARGE, static_cast<curl_off_t>(options.max_bytes));
  Set(handle, CURLOPT_FRESH_CONNECT, 1L);
  Set(handle, CURLOPT_FORBID_REUSE, 1L);
  Set(handle, CURLOPT_NOPROGRESS, 0L);
}

void SetCallbacks(CURL* handle, Run& run) {
  Set(handle, CURLOPT_OPENSOCKETFUNCTION, OnSocket);
  Set(handle, CURLOPT_OPENSOCKETDATA, &run);
  Set(handle, CURLOPT_HEADERFUNCTION, OnHeader);
  Set(handle, CURLOPT_HEADERDATA, &run);
  Set(handle, CURLOPT_WRITEFUNCTION, OnBody);
  Set(handle, CURLOPT_WRITEDATA, &run);
  Set(handle, CURLOPT_XFERINFOFUNCTION, OnProgress);
  Set(handle, CURLOPT_XFERINFODATA, &run);
}

End EndOf(CURLcode code, const Run& run) {
  if (run.too_large) return End::kTooLarge;
  switch (code) {
    case CURLE_OK:
      return End::kAnswered;
    case CURLE_WRITE_ERROR:  // OnBody does not read what is not wanted
      return run.result.status != 0 && run.result.status != kOk ? End::kAnswered : End::kBroken;
    case CURLE_FILESIZE_EXCEEDED:  // said beforehand; of an error's page nobody wants to know
      return run.result.status == kOk ? End::kTooLarge : End::kAnswered;
    case CURLE_OPERATION_TIMEDOUT:
      return End::kTimeout;
    case CURLE_ABORTED_BY_CALLBACK:
      return End::kStopped;
    case CURLE_COULDNT_RESOLVE_HOST:
      return End::kUnknown;
    case CURLE_COULDNT_CONNECT:
      return run.forbidden ? End::kForbidden : End::kUnreachable;
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
    case CURLE_SSL_ISSUER_ERROR:
    case CURLE_SSL_CONNECT_ERROR:
      return End::kUntrusted;
    default:
      return End::kBroken;
  }
}

}  // namespace

void PrepareTransfers() {
  static std::once_flag once;
  std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
}

TransferResult Transfer(const WebAddress& address, const TransferOptions& options) {
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle(Required(curl_easy_init()),
                                                                   curl_easy_cleanup);
  Run run{options, handle.get()};
  List headers;
  headers.Add("Accept: image/*");
  headers.Add("Accept-Encoding: identity");
  List resolve;
  for (const std::string& entry : options.resolve) resolve.Add(entry);
  std::array<char, CURL_ERROR_SIZE> text{};
  SetRequest(handle.get(), address, options);
  SetLimits(handle.get(), options);
  SetCallbacks(handle.get(), run);
  Set(handle.get(), CURLOPT_HTTPHEADER, headers.items);
  if (resolve.items != nullptr) Set(handle.get(), CURLOPT_RESOLVE, resolve.items);
  Set(handle.get(), CURLOPT_ERRORBUFFER, text.data());
  const CURLcode code = curl_easy_perform(handle.get());
  long status = 0;
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
  run.result.status = static_cast<int>(status);
  run.result.end = EndOf(code, run);
  if (run.result.end != End::kAnswered) {
    run.result.internal = text.front() != '\0' ? text.data() : curl_easy_strerror(code);
    run.result.body.clear();
  }
  return std::move(run.result);
}

}  // namespace pliant::server
