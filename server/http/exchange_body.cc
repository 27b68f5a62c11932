// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading bodies: plain ones and forms, within their limits.
#include <fmt/format.h>

#include "descriptor/base/format_bytes.h"
#include "index/files/text.h"
#include "server/http/exchange.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMaxParts = 64;
constexpr std::size_t kMaxFieldBytes = 64 * 1024;  // of a form field that is not the picture

// The library adds up the lengths of chunks before it reads them (0.18), and leaves its verdict in
// the answer.
bool RefusedAsTooLarge(const httplib::Response& answer) { return answer.status == 413; }

}  // namespace

void Exchange::WithBody(const httplib::ContentReader& reader, httplib::Response& answer) {
  try {
    if (request_.received) {
      // It is where it belongs.
    } else if (request_.is_multipart()) {
      ReadMultipart(reader, answer);
    } else {
      ReadPlain(reader, answer);
    }
    must_close_ = false;
  } catch (...) {
    AnswerProblem(CurrentProblem(), answer);
    return;
  }
  RunHandler(answer);
}

void Exchange::ReadPlain(const httplib::ContentReader& reader, const httplib::Response& answer) {
  bool too_large = false;
  const bool whole = reader([&](const char* data, std::size_t size) {
    too_large = request_.body.size() + size > shared_.max_body_bytes;
    if (too_large) return false;
    request_.body.append(data, size);
    return true;
  });
  if (!whole) throw BodyProblem(too_large || RefusedAsTooLarge(answer), false);
}

void Exchange::ReadMultipart(const httplib::ContentReader& reader,
                             const httplib::Response& answer) {
  bool too_large = false;
  bool too_many = false;
  bool is_field = false;  // that is too large, which only a picture may be
  std::size_t total = 0;
  const bool whole = reader(
      [&](const httplib::MultipartFormData& part) {
        too_many = request_.parts.size() == kMaxParts;
        if (too_many) return false;
        request_.parts.push_back({part.name, part.filename, part.content_type, {}});
        return true;
      },
      [&](const char* data, std::size_t size) {
        Part& part = request_.parts.back();
        total += size;
        too_large = total > shared_.max_body_bytes;
        is_field = part.name != "image" && part.content.size() + size > kMaxFieldBytes;
        if (too_large || is_field) return false;
        part.content.append(data, size);
        return true;
      });
  if (whole) return;
  if (is_field) {
    throw ProblemError(
        "body_too_large",
        fmt::format("The form field \"{}\" has more than {} bytes. Only a picture may, "
                    "whose field is called \"image\".",
                    ToDisplayText(request_.parts.back().name.substr(0, 64)), kMaxFieldBytes));
  }
  throw BodyProblem(too_large || RefusedAsTooLarge(answer), too_many);
}

ProblemError Exchange::BodyProblem(bool too_large, bool too_many_parts) const {
  if (too_many_parts) {
    return ProblemError("bad_request", fmt::format("The form has more than {} parts.", kMaxParts));
  }
  if (too_large || connection_.fault() == Connection::Fault::kBodyTooLarge) {
    return ProblemError("body_too_large", fmt::format("A body may have {}, and a form field {}.",
                                                      FormatBytes(shared_.max_body_bytes),
                                                      FormatBytes(kMaxFieldBytes)));
  }
  if (connection_.fault() == Connection::Fault::kTimeout) {
    return ProblemError("request_timeout", "The body did not arrive in time.");
  }
  return ProblemError("bad_request", request_.is_multipart()
                                         ? "The multipart/form-data body is damaged or incomplete."
                                         : "The body is damaged or incomplete.");
}

}  // namespace pliant::server
