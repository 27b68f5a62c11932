// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which network addresses the server may connect to when a client names a host.
#pragma once

#include <string>

#include <sys/socket.h>

namespace pliant::server {

enum class AddressKind {
  kPublic,   // anybody's, on the Internet
  kPrivate,  // of this machine, or of a network of its own: an operator may allow it
  kNever,    // what is no host's (multicast, unspecified, reserved), or a network's own business
             // (link-local, where clouds keep their secrets), or leads elsewhere (6to4, Teredo)
};

// By the registries of special addresses (RFC 6890 with its updates). An IPv4 address inside an
// IPv6 one (mapped, or NAT64's) is what the IPv4 address is; a private one behind NAT64 is kNever.
// Families other than those two are kNever.
AddressKind KindOf(const sockaddr* address);

// A host as it is compared: in lower case, and an IPv6 address, which is in brackets, in its
// shortest form.
std::string CanonicalHost(std::string host);

}  // namespace pliant::server
