// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/run_server.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <thread>

#include <pthread.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include "index/store/open_store.h"
#include "index/usage/usage.h"
#include "server/auth/gate.h"
#include "server/http/http_server.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

using Seconds = std::chrono::seconds;

constexpr Seconds kGraceAfterDeadline{5};
constexpr const char* kTextPattern = "%Y-%m-%dT%H:%M:%S.%eZ %l %v";
constexpr const char* kJsonPattern = R"({"time":"%Y-%m-%dT%H:%M:%S.%eZ","level":"%l",%*})";

// The message as members of a JSON object. A message that is an object keeps its members.
class JsonMembers : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& out) override {
    const std::string text(message.payload.data(), message.payload.size());
    const std::string members = text.starts_with("{\"event\":")
                                    ? text.substr(1, text.size() - 2)
                                    : "\"message\":" + ToText(Json(text));
    out.append(members.data(), members.data() + members.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<JsonMembers>();
  }
};

bool json_lines = false;  // set once, before any thread

std::string RequestText(const RequestRecord& record) {
  return fmt::format("{} {} {} {} in={} out={} ms={:.1f} from={} id={}{}{}{}", record.method,
                     record.path, record.status, record.route, record.bytes_in, record.bytes_out,
                     record.seconds * 1000, record.remote_address, record.id,
                     record.key_id.empty() ? "" : " key=" + record.key_id,
                     record.code.empty() ? "" : " code=" + record.code,
                     record.internal.empty() ? "" : " cause=" + record.internal);
}

std::string RequestJson(const RequestRecord& record) {
  Json json = {{"event", "request"},
               {"method", record.method},
               {"path", record.path},
               {"status", record.status},
               {"route", record.route},
               {"bytes_in", record.bytes_in},
               {"bytes_out", record.bytes_out},
               {"ms", std::round(record.seconds * 1e4) / 10},
               {"client", record.remote_address},
               {"request_id", record.id}};
  if (!record.key_id.empty()) json["key"] = record.key_id;
  if (!record.code.empty()) json["code"] = record.code;
  if (!record.internal.empty()) json["cause"] = record.internal;
  return ToText(json);
}

void StartLog(const ServerOptions& options) {
  json_lines = options.log_format == "json";
  auto formatter = std::make_unique<spdlog::pattern_formatter>(spdlog::pattern_time_type::utc);
  formatter->add_flag<JsonMembers>('*').set_pattern(json_lines ? kJsonPattern : kTextPattern);
  auto logger = spdlog::stderr_logger_mt("pliant-server");
  logger->set_formatter(std::move(formatter));
  logger->set_level(spdlog::level::from_str(options.log_level));
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
}

// One line per request. No key, no query, no content. All servers of all parts ask for peer.get.
void LogRequest(const RequestRecord& record) {
  const auto level = record.route == "peer.get" ? spdlog::level::debug
                     : record.status >= 500     ? spdlog::level::warn
                                                : spdlog::level::info;
  if (!spdlog::should_log(level)) return;
  spdlog::log(level, "{}", json_lines ? RequestJson(record) : RequestText(record));
}

// Must run before any thread starts: they inherit the mask, so that only sigwait() sees these.
sigset_t BlockStopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

bool StopSignalWithin(const sigset_t& signals, std::chrono::milliseconds time) {
  const auto until = std::chrono::steady_clock::now() + time;
  while (true) {
    const auto left = std::max(std::chrono::nanoseconds(0),
                               std::chrono::nanoseconds(until - std::chrono::steady_clock::now()));
    const timespec wait = {left.count() / 1'000'000'000, left.count() % 1'000'000'000};
    if (sigtimedwait(&signals, nullptr, &wait) > 0) return true;
    if (errno != EINTR) return false;  // a process that was stopped and goes on has not waited
  }
}

std::string AddressText(const HttpOptions& http, int port) {
  const bool v6 = http.host.find(':') != std::string::npos;
  const std::string scheme = http.tls_certificate.empty() ? "http" : "https";
  return scheme + "://" + (v6 ? "[" + http.host + "]" : http.host) + ":" + std::to_string(port);
}

// Sockets are files: the usual limit of 1024 is meant for select(), which is not used here.
void AllowConnections(int connections) {
  constexpr rlim_t kOthers = 256;  // database, log, images
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0) return;
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
  if (files.rlim_max != RLIM_INFINITY &&
      files.rlim_max < static_cast<rlim_t>(connections) + kOthers) {
    spdlog::warn(
        "the system's limit of {} open files is too low for --max-connections {}; raise the "
        "limit (ulimit -Hn, LimitNOFILE) or lower the option",
        files.rlim_max, connections);
  }
}

// After a stop signal: a thread that cannot be joined in time must not keep the process.
[[noreturn]] void EndNow(int status) {
  spdlog::shutdown();
  std::_Exit(status);
}

// For long work that cannot be interrupted: the database survives an end at any moment.
void RunUnlessStopped(const sigset_t& signals, const std::function<void()>& work) {
  std::future<void> done = std::async(std::launch::async, work);
  while (done.wait_for(std::chrono::milliseconds(0)) != std::future_status::ready) {
    if (StopSignalWithin(signals, std::chrono::milliseconds(20))) EndNow(0);
  }
  done.get();
}

// The exit status once all requests are answered or cut off; until then negative.
using DrainedStatus = std::atomic<int>;

// Ends the process at a second signal, or when requests or saving the index outlast the deadline.
void StartWatchdog(const sigset_t& signals, Seconds patience,
                   const std::shared_ptr<const DrainedStatus>& drained) {
  // Static objects may be gone when it wakes, so it holds the log.
  std::thread watchdog([signals, patience, drained, log = spdlog::default_logger()] {
    const bool again = StopSignalWithin(signals, patience);
    const int status = *drained;
    if (status >= 0) {  // a job goes on after the next start
      log->warn(
          "{}: the server stops before the index is saved in files. Nothing is lost, but the next "
          "start takes longer: it reads what is not saved from the database",
          again ? "second signal" : "saving the index takes too long");
    } else {
      log->warn("{}: the server stops immediately",
                again ? "second signal" : "requests take too long");
    }
    log->flush();
    std::_Exit(status >= 0 ? status : 1);
  });
  watchdog.detach();
}

int StopServing(HttpServer& http, Service& service, const ServerOptions& options,
                const sigset_t& signals) {
  const Seconds deadline(options.shutdown_timeout_s);
  spdlog::info("stopping: running requests have {} s to finish", options.shutdown_timeout_s);
  const auto drained = std::make_shared<DrainedStatus>(-1);
  StartWatchdog(signals, deadline + kGraceAfterDeadline, drained);
  service.fetcher.Stop();
  const std::size_t cut_off = http.Drain(deadline);
  const int status = cut_off > 0 ? 1 : 0;
  *drained = status;
  if (cut_off > 0) {
    spdlog::warn("stopped: {} requests were cut off", cut_off);
  } else {
    spdlog::info("stopped");
  }
  return status;
}

}  // namespace

void PrintDecoderProtection(const ServerOptions& options) {
  std::string text = "are decoded in the server";
  if (const auto decoder = MakeServiceOptions(options).decoder) {
    try {
      const DecoderPool pool(*decoder);
      text = "are decoded in child processes with limits on memory and time, and ";
      text += pool.missing().empty() ? "on system calls"
                                     : "none on system calls (" + pool.missing() + ")";
    } catch (const Error& error) {
      text = std::string("cannot be decoded: ") + error.what();
    }
  }
  std::printf("# Images %s.\n", text.c_str());
}

int RunServer(const ServerOptions& options) {
  // A file at its size limit (ulimit -f) is a failed write, as a full disk is.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGCHLD, SIG_DFL);  // our parent may ignore it; then waitpid() would fail
  const sigset_t signals = BlockStopSignals();
  StartLog(options);
  try {
    CheckOptions(options);
    AllowConnections(options.http.max_connections);
    // Before anything writes to the database.
    RunUnlessStopped(signals, [&] { CheckDatabaseFile(options.service.engine.database); });
    HttpOptions http_options = MakeHttpOptions(options);
    KeyRing keys(options.service.engine.database);
    CheckExposure(options, keys.InUse());
    Gate gate(keys, options.rate_limit, options.rate_burst, OpenWithoutKeys(options));
    Service service(MakeServiceOptions(options));
    const Router router(MakeRoutes(service));
    http_options.admit = [&](const Route& route, Request& request) {
      gate.Admit(route, request);
      if (route.needs_index && !service.ready()) {
        throw ProblemError("starting", "The index is still loading. Try again shortly.");
      }
    };
    http_options.on_request = [&](const RequestRecord& record) {
      service.metrics.OnRequest(record);
      LogRequest(record);
    };
    HttpServer http(router, http_options);
    http.Start();
    RunUnlessStopped(signals, [&] { service.Open(); });  // /livez answers meanwhile
    keys.Open();
    std::printf("listening on %s\n", AddressText(http_options, http.port()).c_str());
    std::fflush(stdout);
    int signal = 0;
    sigwait(&signals, &signal);
    return StopServing(http, service, options, signals);
  } catch (const Error& error) {
    spdlog::error("{}", cli::WithFlagNames(error));
    return static_cast<int>(cli::ToExitStatus(error.code()));
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    return 1;
  }
}

}  // namespace pliant::server
