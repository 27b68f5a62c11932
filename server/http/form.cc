// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/form.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "descriptor/base/hex.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostBoundaryBytes = 70;       // RFC 2046, section 5.1.1
constexpr std::size_t kMostHeaderBytes = 16 * 1024;  // of a part
constexpr std::size_t kShownNameBytes = 64;

[[noreturn]] void ThrowForm(const std::string& why) {
  throw ProblemError("bad_request", "Invalid form: " + why);
}

std::string PercentDecoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? HexValue(text[i + 1]) : -1;
    const int low = high >= 0 ? HexValue(text[i + 2]) : -1;
    decoded += low >= 0 ? static_cast<char>(high * 16 + low) : text[i];
    if (low >= 0) i += 2;
  }
  return decoded;
}

// filename* (RFC 8187) before filename: clients that send both encode the other.
std::string FilenameOf(std::string_view disposition) {
  constexpr std::string_view kUtf8 = "utf-8'";
  const std::string extended = FieldParameter(disposition, "filename*");
  const std::size_t quote = extended.find('\'', kUtf8.size());
  if (EqualsIgnoringCase(std::string_view(extended).substr(0, kUtf8.size()), kUtf8) &&
      quote != std::string::npos) {
    return PercentDecoded(std::string_view(extended).substr(quote + 1));
  }
  return FieldParameter(disposition, "filename");
}

// Takes the header fields of a part, and their empty line, off the text. `which`: from 1.
Part TakeHeaders(std::string_view& text, std::size_t which) {
  const std::size_t end = text.starts_with("\r\n") ? 0 : text.find("\r\n\r\n");
  if (end == std::string_view::npos || end > kMostHeaderBytes) {
    ThrowForm(fmt::format(
        "no empty line ends the headers of part {}. Its lines must end with CR LF.", which));
  }
  std::string headers(text.substr(0, end));
  text.remove_prefix(end + (end == 0 ? 2 : 4));
  for (const char* fold : {"\r\n ", "\r\n\t"}) {  // RFC 5322, section 2.2.3
    for (auto at = headers.find(fold); at != headers.npos; at = headers.find(fold, at)) {
      headers.erase(at, 2);
    }
  }
  Part part;
  for (const std::string& line : Split(headers, '\n')) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos)
      ThrowForm(fmt::format("a header of part {} has no colon.", which));
    const std::string_view name = Trimmed(std::string_view(line).substr(0, colon));
    std::string_view value = std::string_view(line).substr(colon + 1);
    if (value.ends_with('\r')) value.remove_suffix(1);
    value = Trimmed(value);
    if (EqualsIgnoringCase(name, "Content-Type")) part.content_type = value;
    if (EqualsIgnoringCase(name, "Content-Transfer-Encoding") &&
        (EqualsIgnoringCase(value, "base64") || EqualsIgnoringCase(value, "quoted-printable"))) {
      ThrowForm(fmt::format("part {} has Content-Transfer-Encoding {}. Send its bytes as they are.",
                            which, Lower(value)));
    }
    if (!EqualsIgnoringCase(name, "Content-Disposition")) continue;
    part.name = FieldParameter(value, "name");
    part.filename = FilenameOf(value);
  }
  if (part.name.empty()) {
    ThrowForm(fmt::format(
        "part {} has no name. It needs Content-Disposition: form-data; name=\"...\".", which));
  }
  return part;
}

}  // namespace

std::string FieldParameter(std::string_view field, std::string_view wanted) {
  std::size_t at = field.find(';');
  while (at < field.size()) {
    const std::size_t end = std::min(field.find_first_of("=;", at + 1), field.size());
    const std::string_view name = Trimmed(field.substr(at + 1, end - at - 1));
    at = end;
    if (end == field.size() || field[end] == ';') continue;
    std::string value;
    at = std::min(field.find_first_not_of(" \t", end + 1), field.size());
    if (field.substr(at, 1) == "\"") {
      for (++at; at < field.size() && field[at] != '"'; ++at) {
        const char next = at + 1 < field.size() ? field[at + 1] : ' ';
        if (field[at] == '\\' && (next == '"' || next == '\\')) ++at;
        value += field[at];
      }
      at = field.find(';', at);
    } else {
      const std::size_t begin = at;
      at = field.find(';', at);
      value = Trimmed(field.substr(begin, at - begin));
    }
    if (EqualsIgnoringCase(name, wanted)) return value;
  }
  return {};
}

std::multimap<std::string, std::string> ParseQuery(std::string_view query) {
  std::multimap<std::string, std::string> values;
  std::string spaced(query);
  std::replace(spaced.begin(), spaced.end(), '+', ' ');
  for (const std::string& one : Split(spaced, '&')) {
    if (one.empty()) continue;
    const std::size_t equals = std::min(one.find('='), one.size());
    values.emplace(PercentDecoded(std::string_view(one).substr(0, equals)),
                   PercentDecoded(std::string_view(one).substr(std::min(equals + 1, one.size()))));
  }
  return values;
}

std::vector<Part> ParseForm(std::string_view content_type, std::string_view body,
                            std::size_t most_parts) {
  const std::string boundary = FieldParameter(content_type, "boundary");
  if (boundary.empty()) {
    ThrowForm("its Content-Type has no boundary. HTTP libraries set this header themselves.");
  }
  if (boundary.size() > kMostBoundaryBytes) {
    ThrowForm(fmt::format("its boundary has more than {} bytes.", kMostBoundaryBytes));
  }
  const std::string delimiter = "\r\n--" + boundary;
  const std::string shown = ToDisplayText(boundary);
  std::size_t end = body.starts_with(delimiter.substr(2)) ? 0 : body.find(delimiter);
  if (end == std::string_view::npos) {
    ThrowForm(fmt::format("no line of the body begins with the boundary, --{}.", shown));
  }
  body.remove_prefix(end == 0 && !body.starts_with('\r') ? delimiter.size() - 2
                                                         : end + delimiter.size());
  std::vector<Part> parts;
  while (!body.starts_with("--")) {  // what comes after the last delimiter means nothing
    const std::size_t line = body.find("\r\n");
    if (line == std::string_view::npos || !Trimmed(body.substr(0, line)).empty()) {
      ThrowForm("a boundary is followed by other text. Expected CR LF, or -- at the end.");
    }
    if (parts.size() == most_parts)
      ThrowForm(fmt::format("it has more than {} parts.", most_parts));
    body.remove_prefix(line + 2);
    Part part = TakeHeaders(body, parts.size() + 1);
    end = body.find(delimiter);
    if (end == std::string_view::npos) {
      ThrowForm(fmt::format("part \"{}\" has no end. After the last part, --{}-- is required.",
                            Shown(part.name, kShownNameBytes), shown));
    }
    part.content = body.substr(0, end);
    body.remove_prefix(end + delimiter.size());
    parts.push_back(std::move(part));
  }
  if (parts.empty()) ThrowForm("it has no parts.");
  return parts;
}

}  // namespace pliant::server
