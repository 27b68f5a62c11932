// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/tar_archive.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <optional>

#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::size_t kBlock = 512;
constexpr std::size_t kMaxNameBytes = 64 * 1024;

[[noreturn]] void ThrowDamaged(std::size_t at, const char* why) {
  throw ProblemError("bad_request", "The TAR archive " + std::string(why) + ", at byte " +
                                        std::to_string(at) + ".");
}

// A field of a header: text up to its first zero.
std::string_view TextOf(std::string_view field) { return field.substr(0, field.find('\0')); }

// Octal digits, with spaces and zeros around, or GNU's base-256 (first bit set). Nothing for
// anything else.
std::optional<std::uint64_t> NumberOf(std::string_view field) {
  if (!field.empty() && (static_cast<unsigned char>(field[0]) & 0x80) != 0) {
    std::uint64_t value = static_cast<unsigned char>(field[0]) & 0x7f;
    for (const char c : field.substr(1)) {
      if (value >> 55 != 0) return std::nullopt;
      value = value << 8 | static_cast<unsigned char>(c);
    }
    return value;
  }
  const std::size_t begin = field.find_first_not_of(' ');
  if (begin == std::string_view::npos) return 0;
  const std::string_view digits =
      field.substr(begin, field.find_first_of(std::string_view(" \0", 2), begin) - begin);
  if (digits.empty()) return 0;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 8);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

// The sum of the header's bytes, its own field taken as spaces.
bool IsHeader(std::string_view block) {
  constexpr std::size_t kBegin = 148;
  constexpr std::size_t kEnd = 156;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    sum += i >= kBegin && i < kEnd ? ' ' : static_cast<unsigned char>(block[i]);
  }
  return NumberOf(block.substr(kBegin, kEnd - kBegin)) == sum;
}

bool IsZero(std::string_view block) {
  return std::all_of(block.begin(), block.end(), [](char c) { return c == '\0'; });
}

// Records "length key=value\n" of a pax header (POSIX.1-2001).
struct Pax {
  std::optional<std::string> path;
  std::optional<std::uint64_t> size;
};

Pax ReadPax(std::string_view text, std::size_t at) {
  Pax pax;
  while (!text.empty()) {
    std::size_t length = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), length);
    const auto digits = static_cast<std::size_t>(end - text.data());
    if (error != std::errc() || length > text.size() || length < digits + 3 ||
        text[digits] != ' ' || text[length - 1] != '\n') {
      ThrowDamaged(at, "has a damaged pax header");
    }
    const std::string_view record = text.substr(digits + 1, length - digits - 2);
    const std::size_t equals = record.find('=');
    if (equals == std::string_view::npos) ThrowDamaged(at, "has a damaged pax header");
    const std::string_view key = record.substr(0, equals);
    const std::string_view value = record.substr(equals + 1);
    if (key == "path") pax.path = std::string(value);
    if (key == "size") {
      std::uint64_t size = 0;
      const auto [stop, bad] = std::from_chars(value.data(), value.data() + value.size(), size);
      if (bad != std::errc() || stop != value.data() + value.size()) {
        ThrowDamaged(at, "has a damaged pax header");
      }
      pax.size = size;
    }
    text.remove_prefix(length);
  }
  return pax;
}

std::string NameOf(std::string_view header) {
  const std::string_view name = TextOf(header.substr(0, 100));
  const bool is_ustar = header.substr(257, 6) == std::string_view("ustar\0", 6);
  const std::string_view prefix = is_ustar ? TextOf(header.substr(345, 155)) : std::string_view();
  return prefix.empty() ? std::string(name) : std::string(prefix) + "/" + std::string(name);
}

}  // namespace

std::vector<TarFile> ReadTar(std::string_view archive, std::size_t most) {
  std::vector<TarFile> files;
  Pax next;  // what is said of the next file
  std::size_t at = 0;
  while (true) {
    if (at == archive.size() && at > 0) return files;  // some writers leave the end out
    if (archive.size() - at < kBlock) ThrowDamaged(at, "ends too early");
    const std::string_view header = archive.substr(at, kBlock);
    if (IsZero(header)) return files;
    if (at == 0 && archive.starts_with("\x1f\x8b")) {
      throw ProblemError("bad_request", "The TAR archive is compressed. Send it uncompressed.");
    }
    if (!IsHeader(header)) ThrowDamaged(at, at == 0 ? "is none" : "is damaged");
    const char type = header[156];
    const auto stated = NumberOf(header.substr(124, 12));
    const bool is_about_next = type == 'x' || type == 'L';
    const auto size = is_about_next || !next.size ? stated : next.size;
    const bool has_content =
        type != '1' && type != '2' && type != '3' && type != '4' && type != '5' && type != '6';
    if (!size || (has_content && *size > archive.size() - at - kBlock)) {
      ThrowDamaged(at, "ends too early");
    }
    const std::string_view content =
        archive.substr(at + kBlock, has_content ? static_cast<std::size_t>(*size) : 0);
    if (is_about_next && content.size() > kMaxNameBytes) ThrowDamaged(at, "has too long a header");
    if (type == 'x') {
      next = ReadPax(content, at);
    } else if (type == 'L') {
      next.path = std::string(TextOf(content));
    } else if (type != 'g' && type != 'K') {
      if (type == '0' || type == '\0' || type == '7') {
        std::string name = next.path.value_or(NameOf(header));
        if (!name.ends_with('/')) files.push_back({std::move(name), content});
        if (files.size() > most) {
          throw ProblemError("invalid_parameter",
                             "The archive has more than " + std::to_string(most) + " files.")
              .Parameter("body");
        }
      }
      next = {};
    }
    const std::size_t blocks = (content.size() + kBlock - 1) / kBlock;
    // The last file need not be filled up.
    at = std::min(archive.size(), at + kBlock + blocks * kBlock);
  }
}

}  // namespace pliant::server
