// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/run_server.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <future>
#include <thread>

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include "index/store/open_store.h"
#include "index/usage/usage.h"
#include "server/app/logging.h"
#include "server/auth/gate.h"
#include "server/http/http_server.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

using Seconds = std::chrono::seconds;

constexpr Seconds kGraceAfterDeadline{5};

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
        "the system allows {} open files: too few for --max-connections {}; raise the "
        "limit (ulimit -Hn, LimitNOFILE) or lower the option",
        files.rlim_max, connections);
  }
}

// After a stop signal: a thread that cannot be joined in time must not keep the process.
[[noreturn]] void EndNow(int status) {
  spdlog::shutdown();
  std::_Exit(status);
}

// For what takes long and cannot be interrupted: the database survives being left at any moment.
void RunUnlessStopped(const sigset_t& signals, const std::function<void()>& work) {
  std::future<void> done = std::async(std::launch::async, work);
  while (done.wait_for(std::chrono::milliseconds(0)) != std::future_status::ready) {
    if (StopSignalWithin(signals, std::chrono::milliseconds(20))) EndNow(0);
  }
  done.get();
}

// Ends the process when a second signal comes, or when what runs does not end although its
// connections were cut off.
void StartWatchdog(const sigset_t& signals, Seconds patience) {
  // It may be woken while what is static is already being taken down: the log of its own stays.
  std::thread watchdog([signals, patience, log = spdlog::default_logger()] {
    if (StopSignalWithin(signals, patience)) {
      log->warn("second signal: ending at once");
    } else {
      log->warn("still busy after the deadline: ending at once");
    }
    log->flush();
    std::_Exit(1);
  });
  watchdog.detach();
}

int StopServing(HttpServer& http, Service& service, const ServerOptions& options,
                const sigset_t& signals) {
  const Seconds deadline(options.shutdown_timeout_s);
  spdlog::info("stopping: running requests have {} s to finish", options.shutdown_timeout_s);
  StartWatchdog(signals, deadline + kGraceAfterDeadline);
  service.fetcher.Stop();
  const std::size_t cut_off = http.Drain(deadline);
  if (cut_off > 0) {
    spdlog::warn("stopped: {} requests were cut off", cut_off);
    return 1;
  }
  spdlog::info("stopped");
  return 0;
}

}  // namespace

void PrintDecoderProtection(const ServerOptions& options) {
  std::string text = "inside the server's process";
  if (const auto decoder = MakeDecoderOptions(options)) {
    try {
      const DecoderPool pool(*decoder);
      text = "in processes of their own; memory and time are limited, system calls ";
      text += pool.missing().empty() ? "are, too" : "are not (" + pool.missing() + ")";
    } catch (const Error& error) {
      text = std::string("nowhere: ") + error.what();
    }
  }
  std::printf("# Images are decoded %s.\n", text.c_str());
}

int RunServer(const ServerOptions& options) {
  // A file that may not grow any more (ulimit -f) is an error of the writing, as a full disk is.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGCHLD, SIG_DFL);  // who starts us may ignore it; then decoders' ends would be lost
  const sigset_t signals = BlockStopSignals();
  StartLog(options);
  try {
    CheckOptions(options);
    AllowConnections(options.max_connections);
    // Before anything writes to it, even the log of a database that does not belong to it.
    if (options.check_database) {
      RunUnlessStopped(signals, [&] { CheckDatabaseFile(options.database); });
    }
    const HttpOptions http_options = MakeHttpOptions(options);
    KeyRing keys(options.database);
    CheckExposure(options, keys.InUse());
    Gate gate(keys, options.rate_limit, options.rate_burst, OpenWithoutKeys(options));
    Service service(MakeServiceOptions(options));
    const Router router(MakeRoutes(service));
    HttpServer http(
        router, http_options,
        [&gate](const Route& route, Request& request) { gate.Admit(route, request); },
        [&service](const RequestRecord& record) {
          service.metrics.OnRequest(record);
          LogRequest(record);
        });
    http.Start();
    RunUnlessStopped(signals, [&] { service.Open(); });  // while /livez answers already
    keys.Open();
    http.SetReady(true);
    std::printf("listening on %s\n", AddressText(http_options, http.port()).c_str());
    std::fflush(stdout);
    int signal = 0;
    sigwait(&signals, &signal);
    return StopServing(http, service, options, signals);
  } catch (const Error& error) {
    spdlog::error("{}", cli::WithFlagNames(error));
    return 1;
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    return 1;
  }
}

}  // namespace pliant::server
