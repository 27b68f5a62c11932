// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Running the handler, and what becomes of what it returns: an answer under the request's
// conditions, compressed, with the headers that all have; or waiting.
#include <stdexcept>
#include <utility>

#include "server/http/conditions.h"
#include "server/http/exchange.h"
#include "server/http/parameters.h"

namespace pliant::server {

void Exchange::LeaveWithoutAnswer(httplib::Response& answer) {
  answer.status = 200;  // goes nowhere
  connection_.DropOutput();
}

void Exchange::BeginWait(Wait wait, httplib::Response& answer) {
  if (request_.waited || route_->body != BodyKind::kNone) {
    throw std::logic_error("route " + route_->name + " may not wait here");
  }
  if (++shared_.waiting > shared_.max_waiting) {
    --shared_.waiting;
    throw ProblemError("busy", "Too many requests are waiting. Ask again without.").RetryAfter(5);
  }
  wait_ = std::move(wait);
  LeaveWithoutAnswer(answer);
}

void Exchange::EndWait() {
  if (!wait_) return;
  wait_.reset();
  --shared_.waiting;
}

void Exchange::RunHandler(httplib::Response& answer) {
  try {
    const Parameters parameters(*route_, request_);
    Response response = route_->handler(request_, parameters);
    if (response.wait) {
      BeginWait(std::move(*response.wait), answer);
    } else {
      Answer(UnderConditions(request_, std::move(response)), answer);
    }
  } catch (const RangeOutside& outside) {
    Problem problem =
        ProblemError("range_not_satisfiable", "The range is outside of what there is.").problem();
    record_.code = problem.code;
    Response response = ProblemResponse(problem, request_.id);
    response.headers.emplace_back("Content-Range", outside.content_range());
    Answer(std::move(response), answer);
  } catch (...) {
    AnswerProblem(CurrentProblem(), answer);
  }
}

void Exchange::Answer(Response response, httplib::Response& answer) {
  shared_.compressor.Compress(request_, response);
  answer.status = response.status;
  answer.body = std::move(response.body);
  answer.headers.clear();
  if (response.file && response.file->size() > 0) {
    AnswerWithFile(response.file, response.content_type, answer);
  } else if (!response.content_type.empty()) {
    answer.set_header("Content-Type", response.content_type);
  }
  takes_ranges_ = false;
  for (const auto& [name, value] : response.headers) {
    answer.set_header(name, value);
    takes_ranges_ = takes_ranges_ || name == "Accept-Ranges";
  }
  answer.set_header("X-Request-Id", request_.id);
  AddSecurityHeaders(answer);
  if (must_close_) answer.set_header("Connection", "close");
  answered_ = true;
}

// The library writes a length and then believes that it writes the bytes.
void Exchange::AnswerWithFile(const std::shared_ptr<const BodyFile>& file,
                              const std::string& content_type, httplib::Response& answer) {
  record_.bytes_out = file->size();
  answer.set_content_provider(
      file->size(), content_type,
      [this, file](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        static constexpr char kNotRead = 0;
        if (offset == 0) connection_.SendFile(file);
        sink.write(&kNotRead, length);
        return true;
      });
}

// Nothing here is meant to be run, framed or loaded by pages of other sites; the page brings rules
// of its own.
void Exchange::AddSecurityHeaders(httplib::Response& answer) const {
  answer.set_header("X-Content-Type-Options", "nosniff");
  if (!answer.has_header("Content-Security-Policy")) {
    answer.set_header("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'");
  }
  if (!answer.has_header("Referrer-Policy")) answer.set_header("Referrer-Policy", "no-referrer");
  if (shared_.encrypted) answer.set_header("Strict-Transport-Security", "max-age=31536000");
  for (const auto& [name, value] : shared_.origins.Headers(request_)) {
    answer.set_header(name, value);
  }
}

void Exchange::AnswerProblem(const Problem& problem, httplib::Response& answer) {
  record_.code = problem.code;
  record_.internal = problem.internal;
  Answer(ProblemResponse(problem, request_.id), answer);
}

}  // namespace pliant::server
