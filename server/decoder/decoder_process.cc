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

#include "server/decoder/sandbox.h"
#include "server/decoder/wire.h"

namespace pliant::server {

namespace {

using Cause = DecoderEnded::Cause;

constexpr std::chrono::seconds kStartTimeout{60};

[[noreturn]] void ThrowBroken(const std::string& what) {
  throw DecoderEnded(Cause::kBroken, "it gave an answer that cannot be: " + what);
}

// A field of the answer: printable, whatever the decoder has put there.
template <std::size_t kSize>
std::string TextOf(const char (&field)[kSize]) {
  std::string text(field, strnlen(field, kSize));
  std::replace_if(text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

// Only what DecodeImage throws.
Error ErrorOf(const DecodeAnswer& answer) {
  struct Known {
    ErrorCode code;
    std::string_view reason;
  };
  static constexpr auto kKnown = std::to_array<Known>({
      {ErrorCode::kTooLarge, "image_too_large"},
      {ErrorCode::kUnsupportedMediaType, "image_type_unknown"},
      {ErrorCode::kUnprocessable, "image_empty"},
      {ErrorCode::kUnprocessable, "image_too_small"},
      {ErrorCode::kUnprocessable, "image_truncated"},
      {ErrorCode::kUnprocessable, "image_corrupt"},
  });
  const std::string reason = TextOf(answer.reason);
  for (const Known& known : kKnown) {
    if (known.reason == reason && answer.error_code == static_cast<int>(known.code)) {
      return {known.code, reason, TextOf(answer.message)};
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
      answer.format > static_cast<int>(ImageFormat::kTiff)) {
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

// What is open in it, and which signals it hears.
class SpawnPlan {
 public:
  explicit SpawnPlan(int socket) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawnattr_init(&attributes_);
    Check(posix_spawn_file_actions_adddup2(&actions_, socket, kDecoderSocket));
    OpenNull(STDIN_FILENO, O_RDONLY);
    OpenNull(STDOUT_FILENO, O_WRONLY);
    if (!kSanitized) OpenNull(STDERR_FILENO, O_WRONLY);  // else what a sanitizer finds is lost
    Check(posix_spawn_file_actions_addclosefrom_np(&actions_, kDecoderSocket + 1));
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

  const posix_spawn_file_actions_t* actions() const { return &actions_; }
  const posix_spawnattr_t* attributes() const { return &attributes_; }

 private:
  void OpenNull(int file, int mode) {
    Check(posix_spawn_file_actions_addopen(&actions_, file, "/dev/null", mode, 0));
  }
  static void Check(int error) {
    if (error != 0) ThrowNotStarted("posix_spawn", error);
  }

  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
};

// Libraries start no threads; where they lie, if not at their usual places; and what a sanitizer is
// told. No more: the server's environment may hold secrets.
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

// Enough for the image during which it comes to be worn.
std::int64_t CpuLimit(const DecoderOptions& options) {
  const auto whole = std::chrono::ceil<std::chrono::seconds>(options.worn_after + options.timeout);
  return whole.count();
}

struct StartedDecoder {
  pid_t id = -1;
  int socket = -1;  // ours, not blocking
};

// The program with an empty environment and no open file but its socket; SIGINT and SIGTERM, which
// a terminal or a service manager sends to all processes, do not reach it. Throws Error
// kUnavailable "decoder_not_started".
StartedDecoder StartDecoder(const DecoderOptions& options) {
  struct Ends {  // closed again, whatever is thrown
    ~Ends() {
      for (const int end : both) {
        if (end >= 0) close(end);
      }
    }
    int both[2] = {-1, -1};
  } pair;
  int* const ends = pair.both;
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    ThrowNotStarted("socketpair", errno);
  }
  StartedDecoder started;
  int error = 0;
  {
    const SpawnPlan plan(ends[1]);
    std::vector<std::string> arguments = {
        "pliant-server", kDecoderArgument, std::to_string(getpid()),
        std::to_string(options.memory_bytes), std::to_string(CpuLimit(options))};
    std::vector<std::string> environment = Environment();
    error = fcntl(ends[0], F_SETFL, O_NONBLOCK) == 0 ? 0 : errno;
    if (error == 0) {
      error = posix_spawn(&started.id, options.program.c_str(), plan.actions(), plan.attributes(),
                          Pointers(arguments).data(), Pointers(environment).data());
    }
  }
  if (error != 0) ThrowNotStarted(options.program.string(), error);
  started.socket = std::exchange(ends[0], -1);
  return started;
}

}  // namespace

const char* DecoderCauseName(DecoderEnded::Cause cause) {
  constexpr std::array kNames = {"crashed", "forbidden", "killed", "timeout", "broken"};
  static_assert(kNames.size() == kDecoderCauses);
  return kNames.at(static_cast<std::size_t>(cause));
}

DecoderProcess::DecoderProcess(const DecoderOptions& options) : options_(options) {
  const StartedDecoder started = StartDecoder(options);
  pid_ = started.id;
  socket_ = started.socket;
}

DecoderProcess::~DecoderProcess() {
  Kill();
  close(socket_);
}

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
  pollfd waiting = {socket_, POLLIN, 0};
  if (poll(&waiting, 1, 0) == 0) return;
  if ((waiting.revents & POLLHUP) != 0) ThrowEnded();
  throw DecoderEnded(Cause::kBroken, "it spoke without being asked");
}

std::variant<DecodedImage, Error> DecoderProcess::Decode(Bytes bytes,
                                                         const DecodeOptions& options) {
  const Clock::time_point deadline = Clock::now() + options_.timeout;
  DecodeRequest request;
  request.options = options;
  request.bytes = bytes.size();
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
    pollfd ready = {socket_, events, 0};
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
  while (bytes > 0) {
    const ssize_t n = send(socket_, next, bytes, MSG_NOSIGNAL);
    if (n >= 0) {
      next += n;
      bytes -= static_cast<std::size_t>(n);
    } else if (errno == EAGAIN) {
      Wait(POLLOUT, deadline);
    } else if (errno != EINTR) {
      ThrowEnded();
    }
  }
}

void DecoderProcess::Receive(void* to, std::size_t bytes, Clock::time_point deadline) {
  auto* next = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t n = recv(socket_, next, bytes, 0);
    if (n > 0) {
      next += n;
      bytes -= static_cast<std::size_t>(n);
    } else if (n < 0 && errno == EAGAIN) {
      Wait(POLLIN, deadline);
    } else if (n == 0 || errno != EINTR) {
      ThrowEnded();
    }
  }
}

// It has closed its end, or is gone.
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
    throw DecoderEnded(Cause::kCrashed, "it left with status " + std::to_string(ended.si_status));
  }
  const Cause cause = ended.si_status == SIGSYS    ? Cause::kForbidden
                      : ended.si_status == SIGKILL ? Cause::kKilled
                                                   : Cause::kCrashed;
  throw DecoderEnded(cause, cause == Cause::kForbidden
                                ? "it made a system call that decoding does not need"
                                : std::string("signal ") + std::to_string(ended.si_status) + " (" +
                                      strsignal(ended.si_status) + ")");
}

}  // namespace pliant::server
