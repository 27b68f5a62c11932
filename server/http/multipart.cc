// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/multipart.h"

#include <fmt/format.h>

#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "server/http/problem.h"
#include "server/http/request_head.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostFieldBytes = 64 * 1024;  // of a part that is not an image
constexpr std::size_t kMostBoundaryBytes = 70;      // RFC 2046, section 5.1.1

[[noreturn]] void ThrowDamaged() {
  throw ProblemError("bad_request", "The multipart/form-data body is damaged or incomplete.");
}

// Takes what is before `mark` off the text, and the mark.
std::string_view TakeUpTo(std::string_view& text, std::string_view mark) {
  const std::size_t end = text.find(mark);
  if (end == std::string_view::npos) ThrowDamaged();
  const std::string_view taken = text.substr(0, end);
  text.remove_prefix(end + mark.size());
  return taken;
}

// Takes the headers of a part, and their empty line, off the text.
Part TakeHeaders(std::string_view& text) {
  Part part;
  bool is_form_data = false;
  for (auto line = TakeUpTo(text, "\r\n"); !line.empty(); line = TakeUpTo(text, "\r\n")) {
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) ThrowDamaged();
    const std::string name = Lower(Trimmed(line.substr(0, colon)));
    const std::string_view value = Trimmed(line.substr(colon + 1));
    if (name == "content-type") part.content_type = value;
    if (name != "content-disposition") continue;
    is_form_data = Lower(value.substr(0, value.find(';'))) == "form-data";
    part.name = FieldParameter(value, "name");
    part.filename = FieldParameter(value, "filename");
  }
  if (!is_form_data) ThrowDamaged();
  return part;
}

}  // namespace

std::vector<Part> ParseMultipart(std::string_view content_type, std::string_view body,
                                 std::size_t most_parts) {
  const std::string boundary = FieldParameter(content_type, "boundary");
  const std::string delimiter = "\r\n--" + boundary;
  const std::string first = delimiter.substr(2);
  if (boundary.empty() || boundary.size() > kMostBoundaryBytes || !body.starts_with(first)) {
    ThrowDamaged();
  }
  body.remove_prefix(first.size());
  std::vector<Part> parts;
  while (!body.starts_with("--")) {  // what comes after the last delimiter means nothing
    if (!Trimmed(TakeUpTo(body, "\r\n")).empty()) ThrowDamaged();
    if (parts.size() == most_parts) {
      throw ProblemError("bad_request",
                         fmt::format("The form has more than {} parts.", most_parts));
    }
    Part part = TakeHeaders(body);
    const std::string_view content = TakeUpTo(body, delimiter);
    if (part.name != kImagePart && content.size() > kMostFieldBytes) {
      throw ProblemError("body_too_large",
                         fmt::format("The form field \"{}\" has more than {} bytes. Only an image "
                                     "can have more: send it as \"image\".",
                                     ToDisplayText(part.name.substr(0, 64)), kMostFieldBytes));
    }
    part.content = content;
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace pliant::server
