// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/library_handlers.h"

#include <algorithm>
#include <cctype>
#include <exception>
#include <string>

namespace pliant::server {

namespace {

constexpr const char* kAnyPath = R"([\s\S]*)";

// The library calls its handlers without saying for which connection. One thread serves one
// connection at a time, so this is that thread's exchange.
thread_local Exchange* current_exchange = nullptr;

// Types have no case (RFC 9110, section 8.3.1), but the library knows forms in lower case only.
void LowerMediaType(httplib::Headers& headers) {
  const auto type = headers.find("Content-Type");
  if (type == headers.end()) return;
  std::string& text = type->second;
  const auto end = std::find(text.begin(), text.end(), ';');
  std::transform(text.begin(), end, text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
}

}  // namespace

ServingExchange::ServingExchange(Exchange& exchange) { current_exchange = &exchange; }
ServingExchange::~ServingExchange() { current_exchange = nullptr; }

std::string PrepareForLibrary(httplib::Request& request) {
  request.ranges.clear();
  std::string codings;
  const auto [begin, end] = request.headers.equal_range("Accept-Encoding");
  for (auto header = begin; header != end; ++header) {
    codings += (codings.empty() ? "" : ",") + header->second;
  }
  request.headers.erase("Accept-Encoding");
  LowerMediaType(request.headers);
  return codings;
}

void SetLibraryHandlers(httplib::Server& server) {
  server.set_pre_routing_handler([](const httplib::Request& request, httplib::Response& answer) {
    const bool handled =
        current_exchange->BeforeBody(request, answer) || current_exchange->AwaitsBody(answer);
    return handled ? httplib::Server::HandlerResponse::Handled
                   : httplib::Server::HandlerResponse::Unhandled;
  });
  const auto with_body = [](const httplib::Request&, httplib::Response& answer,
                            const httplib::ContentReader& reader) {
    current_exchange->WithBody(reader, answer);
  };
  server.Post(kAnyPath, with_body);
  server.Put(kAnyPath, with_body);
  server.Patch(kAnyPath, with_body);
  server.Delete(kAnyPath, with_body);
  server.set_expect_100_continue_handler(
      [](const httplib::Request& request, httplib::Response& answer) {
        return current_exchange->BeforeBody(request, answer) ? answer.status : 100;
      });
  // Must be of the kind that returns nothing: the library then sets Content-Length.
  server.set_error_handler([](const httplib::Request& request, httplib::Response& answer) {
    current_exchange->OnLibraryError(request, answer);
  });
  server.set_exception_handler(
      [](const httplib::Request&, httplib::Response& answer, std::exception_ptr error) {
        try {
          std::rethrow_exception(error);
        } catch (...) {
          current_exchange->OnException(answer);
        }
      });
  server.set_post_routing_handler([](const httplib::Request&, httplib::Response& answer) {
    // RFC 9110, section 8.6: these have no content, so they have no length either.
    if (answer.status == 204 || answer.status == 304) answer.headers.erase("Content-Length");
    // The library promises both without asking.
    if (!current_exchange->takes_ranges()) answer.headers.erase("Accept-Ranges");
    if (answer.get_header_value("Connection") == "close") answer.headers.erase("Keep-Alive");
  });
  server.set_logger([](const httplib::Request&, const httplib::Response& answer) {
    current_exchange->NoteAnswer(answer);
  });
}

}  // namespace pliant::server
