// Certificates for tests: an authority of the test's own, and the certificates that it signs.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace voxeld::daemon::access {

struct Issued {
  std::string certificate, key;  // PEM
};

class TestAuthority {
 public:
  explicit TestAuthority(const std::string& name);
  ~TestAuthority();

  const std::string& certificate() const { return certificate_; }  // PEM
  // Issues a certificate for the DNS name `name` and 127.0.0.1, valid from and until that many
  // seconds from now.
  Issued Issue(const std::string& name, int64_t from_s = -3600, int64_t until_s = 3600);
  // The same with an empty subject: many authorities issue such certificates now.
  Issued IssueWithoutSubject(const std::string& name);

 private:
  Issued Issue(const std::string& subject, const std::string& name, int64_t from_s,
               int64_t until_s);
  struct Keys;
  std::unique_ptr<Keys> keys_;
  std::string certificate_;
};

// Replaces a file by one with this text and mode.
void PutFile(const std::string& path, const std::string& text, unsigned mode = 0600);

}  // namespace voxeld::daemon::access
