// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses that a client names: on the web, and of the network behind them.
#pragma once

#include <memory>
#include <string>

#include <curl/urlapi.h>
#include <sys/socket.h>

namespace pliant::server {

// Whether the server can connect to a network address when a client names a host.
enum class AddressKind {
  kPublic,   // a public address
  kPrivate,  // of this machine, or of a network of its own: an operator can allow it
  kNever,    // no host (multicast, unspecified, reserved), link-local (where clouds keep their
             // secrets), or a tunnel (6to4, Teredo)
};

// By the registries of special addresses (RFC 6890 with its updates). An IPv4 address inside an
// IPv6 one (mapped, or NAT64's) has the class of the IPv4 address; a private one behind NAT64 is
// kNever. Other families are kNever.
AddressKind KindOf(const sockaddr* address);

// A host as it is compared: in lower case, and an IPv6 address, which is in brackets, in its
// shortest form.
std::string CanonicalHost(std::string host);

// A client's address on the web, parsed by the library that connects to it: the server checks what
// it then asks for. Used by one thread.
class WebAddress {
 public:
  // Throws Error kInvalidArgument "image_url_invalid" unless the text is an absolute address of
  // http or https, of at most 2048 bytes, without a user, a password and control characters, whose
  // host is a name in ASCII or an address.
  explicit WebAddress(const std::string& text);

  // The address that a redirection from here leads to. Throws the same.
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
