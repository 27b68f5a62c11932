// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What forms send: queries (URL Standard, section 5.1) and multipart/form-data (RFC 7578, RFC
// 2046).
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace pliant::server {

// The names and values of a query, decoded. A % without two hex digits stays as it is.
std::multimap<std::string, std::string> ParseQuery(std::string_view query);

// A parameter of a field such as Content-Type (RFC 9110, section 5.6.6), also with blanks around
// it; empty = there is none. In quotes, \ escapes only " and \, because clients send paths of
// Windows.
std::string FieldParameter(std::string_view field, std::string_view wanted);

// The parts of a whole body, which must outlive them. Reads the forms of all common clients: quoted
// and bare parameters in any order and case, text before the first boundary, blanks behind a
// boundary, and no line end behind the last. Throws ProblemError "bad_request", which says what is
// wrong with the form, also for more than `most_parts` parts.
std::vector<Part> ParseForm(std::string_view content_type, std::string_view body,
                            std::size_t most_parts);

}  // namespace pliant::server
