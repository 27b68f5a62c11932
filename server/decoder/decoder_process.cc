// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/decoder_process.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/decoder/decoder_main.h"
#include "server/decoder/sandbox.h"

namespace pliant::server {

namespace {

using Cause = DecoderEnded::Cause;

constexpr std::chrono::seconds kStartTimeout{60};

[[noreturn]] void ThrowBroken(const std::string& what) {
  throw DecoderEnded(Cause::kBroken, "it sent an invalid answer: " + what);
}

// A field of the answer: printable, whatever the decoder has put there.
template <std::size_t kSize>
std::string TextOf(const char (&field)[kSize]) {
  std::string text(field, strnlen(field, kSize));
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return text;
}

// Only what DecodeImage throws.
Error ErrorOf(const DecodeAnswer& answer) {
  static constexpr std::pair<ErrorCode, std::string_view> kKnown[] = {
      {ErrorCode::kTooLarge, "image_too_large"},
      {ErrorCode::kUnsupportedMediaType, "image_type_unknown"},
      {ErrorCode::kUnprocessable, "image_empty"},
      {ErrorCode::kUnprocessable, "image_too_small"},
      {ErrorCode::kUnprocessable, "image_truncated"},
      {ErrorCode::kUnprocessable, "image_corrupt"},
  };
  const std::string reason = TextOf(answer.reason);
  for (const auto& [code, known] : kKnown) {
    if (known == reason && answer.error_code == static_cast<int>(code)) {
      return {code, reason, TextOf(answer.message)};
    }
  }
  ThrowBroken("the error " + std::to_string(answer.error_code) + " " + reason);
}

Image Blank(const ScaledSize& size, int channels) {
  const std::size_t bytes = static_cast<std::size_t>(size.width) *
                            static_cast<std::size_t>(size.height) *
                            static_cast<std::size_t>(channels);
  return {size.width, size.height, channels, std::vector<std::uint8_t>(bytes)};
}

// Everything but the pixels. The size must be one that DecodeImage can give under these options, so
// that what follows from it (memory, coordinates) is within the limits.
DecodedImage Checked(const DecodeAnswer& answer, const DecodeOptions& options) {
  const std::int64_t width = answer.original_width;
  const std::int64_t height = answer.original_height;
  const std::string said = std::to_string(width) + " x " + std::to_string(height) + " as " +
                           std::to_string(answer.width) + " x " + std::to_string(answer.height) +
                           " x " + std::to_string(answer.channels);
  if (std::min(width, height) < std::max(1, options.min_side_px) ||
      width > options.max_pixels / height) {
    ThrowBroken(said);
  }
  const ScaledSize size =
      ScaleToFit(answer.original_width, answer.original_height, options.max_side_px);
  const int channels = options.colour ? 3 : 1;
  if (answer.width != size.width || answer.height != size.height || answer.channels != channels) {
    ThrowBroken(said);
  }
  if (answer.format <= static_cast<int>(ImageFormat::kUnknown) ||
      answer.format > static_cast<int>(ImageFormat::kAvif)) {
    ThrowBroken("format " + std::to_string(answer.format));
  }
  DecodedImage decoded;
  decoded.image = Blank(size, channels);
  if (options.thumbnail_side_px > 0) {
    decoded.thumbnail = Blank(ScaleToFit(size.width, size.height, options.thumbnail_side_px), 3);
  }
  decoded.original_width = answer.original_width;
  decoded.original_height = answer.original_height;
  decoded.scale = size.scale;
  decoded.format = static_cast<ImageFormat>(answer.format);
  return decoded;
}

[[noreturn]] void ThrowNotStarted(const std::string& what, int error) {
  throw Error(ErrorCode::kUnavailable, "decoder_not_started",
              "a decoder cannot be started: " + what + ": " + std::strerror(error));
}

// The open files of a decoder, and the signals that reach it.
class SpawnPlan {
 public:
  explicit SpawnPlan(int socket) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawnattr_init(&attributes_);
    Check(posix_spawn_file_actions_adddup2(&actions_, socket, kDecoderSocket));
    for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
      if (kSanitized && file == STDERR_FILENO) continue;  // a sanitizer reports there
      Check(posix_spawn_file_actions_addopen(&actions_, file, "/dev/null", O_RDWR, 0));
    }
    Check(posix_spawn_file_actions_addclosefrom_np(&actions_, kDecoderSocket + 1));
    // A terminal or a service manager sends these to all processes.
    sigset_t blocked;
    sigemptyset(&blocked);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&blocked, signal);
    Check(posix_spawnattr_setsigmask(&attributes_, &blocked));
    sigset_t usual;
    sigemptyset(&usual);
    sigaddset(&usual, SIGPIPE);
    Check(posix_spawnattr_setsigdefault(&attributes_, &usual));
    Check(posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF));
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  // Returns 0 or an error number.
  int Run(const std::string& program, char* const* arguments, char* const* environment, pid_t* id) {
    Check(posix_spawn(id, program.c_str(), &actions_, &attributes_, arguments, environment));
    return error_;
  }

 private:
  void Check(int error) { error_ = error_ == 0 ? error : error_; }

  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
  int error_ = 0;
};

// No threads in libraries, the libraries' paths, and a sanitizer's options. No more: the server's
// environment can hold secrets.
std::vector<std::string> Environment() {
  std::vector<std::string> environment = {"OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1"};
  for (const char* name :
       {"LD_LIBRARY_PATH", "ASAN_OPTIONS", "LSAN_OPTIONS", "TSAN_OPTIONS", "UBSAN_OPTIONS"}) {
    const char* value = std::getenv(name);
    if (value != nullptr) environment.push_back(std::string(name) + "=" + value);
  }
  return environment;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

const char* DecoderCauseName(DecoderEnded::Cause cause) {
  constexpr std::array kNames = {"crashed", "forbidden", "killed", "timeout", "broken"};
  static_assert(kNames.size() == kDecoderCauses);
  return kNames.at(static_cast<std::size_t>(cause));
}

DecoderProcess::DecoderProcess(const DecoderOptions& options) : options_(options) {
  // Enough for the image during which it exceeds `worn_after`.
  const auto cpu = std::chrono::ceil<std::chrono::seconds>(options.worn_after + options.timeout);
  std::vector<std::string> arguments = {"pliant-server", kDecoderArgument, std::to_string(getpid()),
                                        std::to_string(options.memory_bytes),
                                        std::to_string(cpu.count())};
  std::vector<std::string> environment = Environment();
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    ThrowNotStarted("socketpair", errno);
  }
  socket_ = FileHandle(ends[0]);
  const FileHandle other(ends[1]);
  const int error = SpawnPlan(ends[1]).Run(options.program.string(), Pointers(arguments).data(),
                                           Pointers(environment).data(), &pid_);
  if (error != 0) ThrowNotStarted(options.program.string(), error);
}

DecoderProcess::~DecoderProcess() { Kill(); }

void DecoderProcess::Kill() {
  if (pid_ < 0) return;
  kill(pid_, SIGKILL);
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
}

std::string DecoderProcess::AwaitReady() {
  DecoderGreeting greeting;
  std::string why;
  try {
    Receive(&greeting, sizeof(greeting), Clock::now() + kStartTimeout);
    why = TextOf(greeting.text);
  } catch (const DecoderEnded& ended) {
    why = ended.what();
  }
  if (greeting.ready == 1) return why;
  throw Error(ErrorCode::kUnavailable, "decoder_not_started", "a decoder did not start: " + why);
}

void DecoderProcess::CheckAlive() {
  pollfd waiting = {socket_.get(), POLLIN, 0};
  if (poll(&waiting, 1, 0) == 0) return;
  if ((waiting.revents & POLLHUP) != 0) ThrowEnded();
  throw DecoderEnded(Cause::kBroken, "it sent unexpected data");
}

std::variant<DecodedImage, Error> DecoderProcess::Decode(Bytes bytes,
                                                         const DecodeOptions& options) {
  const Clock::time_point deadline = Clock::now() + options_.timeout;
  const DecodeRequest request{.options = options, .bytes = bytes.size()};
  Send(&request, sizeof(request), deadline);
  Send(bytes.data(), bytes.size(), deadline);
  DecodeAnswer answer;
  Receive(&answer, sizeof(answer), deadline);
  if (answer.refused != 0) return ErrorOf(answer);
  DecodedImage decoded = Checked(answer, options);
  for (Image* image : {&decoded.image, &decoded.thumbnail}) {
    Receive(image->pixels.data(), image->pixels.size(), deadline);
  }
  return decoded;
}

bool DecoderProcess::worn() const {
  clockid_t clock{};
  timespec used{};
  if (clock_getcpuclockid(pid_, &clock) != 0 || clock_gettime(clock, &used) != 0) return true;
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec) >
         options_.worn_after;
}

void DecoderProcess::Wait(short events, Clock::time_point deadline) {
  using std::chrono::milliseconds;
  for (;;) {
    const auto left = std::chrono::duration_cast<milliseconds>(deadline - Clock::now());
    pollfd ready = {socket_.get(), events, 0};
    const int n = poll(&ready, 1, std::max(0, static_cast<int>(left.count())));
    if (n > 0) return;
    if (n < 0 && errno != EINTR) ThrowEnded();
    if (n == 0) {
      Kill();
      throw DecoderEnded(
          Cause::kTimeout,
          "it took longer than " + std::to_string(options_.timeout.count()) + " ms and was killed");
    }
  }
}

void DecoderProcess::Send(const void* from, std::size_t bytes, Clock::time_point deadline) {
  const auto* next = static_cast<const char*>(from);
  Transfer(bytes, POLLOUT, deadline, [&](std::size_t done) {
    return send(socket_.get(), next + done, bytes - done, MSG_NOSIGNAL | MSG_DONTWAIT);
  });
}

void DecoderProcess::Receive(void* to, std::size_t bytes, Clock::time_point deadline) {
  auto* next = static_cast<char*>(to);
  Transfer(bytes, POLLIN, deadline, [&](std::size_t done) {
    return recv(socket_.get(), next + done, bytes - done, MSG_DONTWAIT);
  });
}

template <typename Call>
void DecoderProcess::Transfer(std::size_t bytes, short event, Clock::time_point deadline,
                              Call call) {
  for (std::size_t done = 0; done < bytes;) {
    const ssize_t n = call(done);
    if (n > 0) {
      done += static_cast<std::size_t>(n);
    } else if (n < 0 && errno == EAGAIN) {
      Wait(event, deadline);
    } else if (n == 0 || errno != EINTR) {
      ThrowEnded();
    }
  }
}

// It has closed its end, or ended.
void DecoderProcess::ThrowEnded() {
  // One that lives on without its socket would not end by itself.
  siginfo_t ended{};
  const auto deadline = Clock::now() + std::chrono::seconds(1);
  while (waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOWAIT | WNOHANG) == 0 &&
         ended.si_pid == 0 && Clock::now() < deadline) {
    poll(nullptr, 0, 1);
  }
  const bool alive = ended.si_pid == 0;
  Kill();
  if (alive) throw DecoderEnded(Cause::kBroken, "it closed its socket");
  if (ended.si_code == CLD_EXITED) {
    throw DecoderEnded(Cause::kCrashed, "it exited with status " + std::to_string(ended.si_status));
  }
  const Cause cause = ended.si_status == SIGSYS    ? Cause::kForbidden
                      : ended.si_status == SIGKILL ? Cause::kKilled
                                                   : Cause::kCrashed;
  throw DecoderEnded(cause, cause == Cause::kForbidden
                                ? "it made a forbidden system call"
                                : std::string("signal ") + std::to_string(ended.si_status) + " (" +
                                      strsignal(ended.si_status) + ")");
}

}  // namespace pliant::server
