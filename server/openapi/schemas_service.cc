// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keys, jobs, backups, problems.
#include "server/openapi/schema_parts.h"

namespace pliant::server {

const char* const kServiceSchemas = R"json({
  "Me": {"type": "object", "required": ["keys_required", "scopes", "key", "image_url"],
    "properties": {
      "keys_required": {"type": "boolean", "description": "false: anybody may do everything"},
      "scopes": {"type": "array", "description": "what the caller may do",
        "items": {"enum": ["read", "write", "admin"]}},
      "key": {"type": ["object", "null"], "required": ["id", "name", "scope"],
        "description": "that was shown; null where none is required",
        "properties": {
          "id": {"type": "string", "description": "public, as in the log"},
          "name": {"type": "string"}, "scope": {"enum": ["read", "write", "admin"]}}},
      "image_url": {"type": "boolean",
        "description": "whether the server fetches pictures by `image_url`, from some hosts"}}},
  "ApiKey": {"type": "object", "required": ["id", "name", "scope", "created_at", "revoked_at"],
    "properties": {
      "id": {"type": "string", "description": "public, as in the log"},
      "name": {"type": "string"}, "scope": {"enum": ["read", "write", "admin"]},
      "created_at": {"type": "string", "format": "date-time"},
      "revoked_at": {"type": ["string", "null"], "format": "date-time", "description": "null: it works"}}},
  "KeyList": {"type": "object", "required": ["keys"],
    "properties": {"keys": {"type": "array", "items": {"$ref": "#/components/schemas/ApiKey"}}}},
  "NewKey": {"allOf": [{"$ref": "#/components/schemas/ApiKey"},
    {"type": "object", "required": ["key"],
      "properties": {"key": {"type": "string", "description": "the key itself, shown only here"}}}]},
  "Problem": {"type": "object",
    "required": ["type", "title", "status", "code", "detail", "request_id"],
    "properties": {
      "type": {"type": "string", "format": "uri"}, "title": {"type": "string"},
      "status": {"type": "integer"},
      "code": {"type": "string", "description": "stable, for programs"},
      "detail": {"type": "string", "description": "for people"},
      "request_id": {"type": "string"},
      "parameter": {"type": "string", "description": "the parameter at fault"},
      "image_id": {"type": "string", "description": "with `same_bytes`: the picture that has them"},
      "object": {"type": "string", "description": "with `same_bytes`: what that picture shows"},
      "progress": {"type": "number", "description": "with `starting`: which share is loaded"}}},
  "ProblemSummary": {"type": "object", "required": ["code", "detail"],
    "properties": {"code": {"type": "string"}, "detail": {"type": "string"},
      "parameter": {"type": "string"}}},
  "Backup": {"type": "object", "required": ["name", "bytes", "created_at"],
    "properties": {"name": {"type": "string"}, "bytes": {"type": "integer"},
      "created_at": {"type": "string", "format": "date-time"}}},
  "BackupList": {"type": "object", "required": ["backups"],
    "properties": {"backups": {"type": "array", "items": {"$ref": "#/components/schemas/Backup"}}}},
  "Job": {"type": "object",
    "required": ["id", "kind", "collection", "parameters", "state", "done", "total", "failed",
      "attempts", "created_at", "finished_at"],
    "properties": {
      "id": {"type": "string"}, "kind": {"type": "string"}, "collection": {"type": "string"},
      "state": {"enum": ["queued", "running", "done", "failed", "cancelled"]},
      "done": {"type": "number", "description": "of `total`"}, "total": {"type": "number"},
      "failed": {"type": "integer", "description": "items that could not be done"},
      "created_at": {"type": "string", "format": "date-time"},
      "finished_at": {"type": ["string", "null"], "format": "date-time"},
      "attempts": {"type": "integer", "description": "times it was begun"},
      "parameters": {"type": "object", "additionalProperties": true},
      "skipped": {"type": "array", "description": "items left out, the first hundred",
        "items": {"type": "object", "required": ["item", "code", "reason"],
          "properties": {"item": {"type": "string"}, "code": {"type": "string"},
            "reason": {"type": "string"}}}},
      "result": {"type": "string", "description": "address of what was made"},
      "problem": {"$ref": "#/components/schemas/ProblemSummary"}}},
  "JobItems": {"type": "object", "required": ["items", "next"],
    "properties": {
      "items": {"type": "array", "items": {"type": "object",
        "required": ["index", "source", "status"],
        "properties": {
          "index": {"type": "integer", "description": "from 0, in the order that was sent"},
          "source": {"type": "string", "description": "the file's name, or the number of its line"},
          "status": {"type": "integer", "description": "as a request of its own would have"},
          "outcome": {"enum": ["created", "replaced", "unchanged"]},
          "image_id": {"type": "string"}, "object": {"type": "string"},
          "problem": {"$ref": "#/components/schemas/ProblemSummary"}}}},
      "next": {"type": ["string", "null"], "description": "cursor of the next page"}}},
  "JobList": {"type": "object", "required": ["jobs"],
    "properties": {"jobs": {"type": "array", "items": {"$ref": "#/components/schemas/Job"}}}}
})json";

}  // namespace pliant::server
