// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Passes what cpp-httplib calls its handlers for to the exchange that the calling thread serves.
#pragma once

#include <httplib.h>

#include "server/http/exchange.h"

namespace pliant::server {

// While it lives, the handlers of this thread serve `exchange`. One at a time.
class ServingExchange {
 public:
  explicit ServingExchange(Exchange& exchange);
  ~ServingExchange();
  ServingExchange(const ServingExchange&) = delete;
  ServingExchange& operator=(const ServingExchange&) = delete;
};

// Sets every handler of `server`. They may only run while a ServingExchange lives in their thread.
void SetLibraryHandlers(httplib::Server& server);

// Takes out of a request what the library would act upon: ranges, which are the exchange's, and the
// codings that the client accepts. Returns these.
std::string PrepareForLibrary(httplib::Request& request);

}  // namespace pliant::server
