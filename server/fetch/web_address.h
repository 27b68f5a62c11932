// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An address on the web that a client has given, taken apart by the library that connects to it:
// what is checked is what is asked.
#pragma once

#include <memory>
#include <string>

#include <curl/urlapi.h>

namespace pliant::server {

// Used by one thread.
class WebAddress {
 public:
  // Throws Error kInvalidArgument "image_url_invalid" for what is no absolute address of http or
  // https, is longer than 2048 bytes, or has a user, a password, control characters or a host that
  // is neither a name of ASCII nor an address.
  explicit WebAddress(const std::string& text);

  // The one that a redirection from here leads to. Throws the same.
  WebAddress Redirected(const std::string& location) const;

  const std::string& scheme() const { return scheme_; }  // "http" or "https"
  const std::string& host() const { return host_; }      // lower case; IPv6 in brackets
  int port() const { return port_; }
  // Without the query and the fragment, where sites put their secrets.
  std::string Display() const;

  CURLU* parts() const { return parts_.get(); }

 private:
  using Parts = std::unique_ptr<CURLU, decltype(&curl_url_cleanup)>;

  WebAddress(Parts parts, const std::string& text);
  std::string Part(CURLUPart which, unsigned flags = 0) const;  // empty = there is none

  Parts parts_;
  std::string scheme_;
  std::string host_;
  int port_ = 0;
};

}  // namespace pliant::server
