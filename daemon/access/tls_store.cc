#include "daemon/access/tls_store.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <cerrno>
#include <ctime>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::access {
namespace {

constexpr off_t kGreatestPem = 1 << 20;

template <auto Free>
struct Freed {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

absl::StatusOr<std::string> ReadPem(const char* what, const std::string& path, bool secret) {
  if (path.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(what, " is not given; TLS needs tls_certificate, tls_key and tls_client_ca"));
  }
  struct stat found;
  if (stat(path.c_str(), &found) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat(what, " ", path));
  }
  if (!S_ISREG(found.st_mode) || found.st_size > kGreatestPem) {
    return absl::InvalidArgumentError(
        absl::StrCat(what, " ", path, " is no file of at most ", kGreatestPem, " bytes"));
  }
  if (secret && (found.st_mode & S_IRWXO) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(what, " ", path, " may be read by everybody; chmod o= ", path));
  }
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  file >> std::noskipws >> text.rdbuf();
  if (!file.eof()) {  // the file could not be opened, or reading failed
    return absl::UnavailableError(absl::StrCat(what, " ", path, " cannot be read"));
  }
  return text.str();
}

Bio Over(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

std::vector<Certificate> CertificatesOf(const std::string& pem) {
  std::vector<Certificate> all;
  const Bio bio = Over(pem);
  for (;;) {
    Certificate next(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
    if (next == nullptr) break;
    all.push_back(std::move(next));
  }
  ERR_clear_error();
  return all;
}

int64_t UnixSeconds(const ASN1_TIME* time) {
  std::tm parts = {};
  return ASN1_TIME_to_tm(time, &parts) == 1 ? static_cast<int64_t>(timegm(&parts)) : 0;
}

// Keeps OpenSSL from asking for a password at the terminal.
int NoPassword(char*, int, int, void*) { return 0; }

}  // namespace

absl::StatusOr<TlsMaterial> ReadTls(const TlsFiles& files, int64_t now_s) {
  TlsMaterial material;
  for (const auto& [what, path, secret, into] :
       {std::tuple("tls_certificate", &files.certificate, false, &material.certificate),
        {"tls_key", &files.key, true, &material.key},
        {"tls_client_ca", &files.client_ca, false, &material.client_ca}}) {
    absl::StatusOr<std::string> text = ReadPem(what, *path, secret);
    if (!text.ok()) return text.status();
    *into = *std::move(text);
  }
  const std::vector<Certificate> chain = CertificatesOf(material.certificate);
  if (chain.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("tls_certificate ", files.certificate,
                                                   " has no certificate; give one in PEM"));
  }
  if (CertificatesOf(material.client_ca).empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("tls_client_ca ", files.client_ca,
                     " has no certificate; give those, in PEM, that clients' are signed with"));
  }
  const Bio bio = Over(material.key);
  const Key key(PEM_read_bio_PrivateKey(bio.get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("tls_key ", files.key, " has no private key in PEM without a password"));
  }
  const bool matches = X509_check_private_key(chain.front().get(), key.get()) == 1;
  ERR_clear_error();
  if (!matches) {
    return absl::InvalidArgumentError(absl::StrCat(
        "tls_key ", files.key, " is not the key of the certificate in ", files.certificate));
  }
  material.expires_s = UnixSeconds(X509_get0_notAfter(chain.front().get()));
  const int64_t begins = UnixSeconds(X509_get0_notBefore(chain.front().get()));
  if (material.expires_s <= now_s || begins > now_s) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the certificate in ", files.certificate,
        begins > now_s ? " is not valid yet; is the clock right?" : " has expired; renew it"));
  }
  return material;
}

TlsStore::Stamps TlsStore::StampAll() const {
  return {StampOf(files_.certificate), StampOf(files_.key), StampOf(files_.client_ca)};
}

absl::StatusOr<std::unique_ptr<TlsStore>> TlsStore::Open(TlsFiles files, Access::WallClock now,
                                                         Logger* log) {
  std::unique_ptr<TlsStore> store(new TlsStore(std::move(files), std::move(now), log));
  if (absl::Status status = store->Look(true); !status.ok()) return status;
  return store;
}

absl::Status TlsStore::Look(bool again) {
  const Stamps stamps = StampAll();
  const int64_t now = now_();
  sync::MutexLock lock(mutex_);
  if (again || stamps != stamps_) {
    stamps_ = stamps;
    absl::StatusOr<TlsMaterial> material = ReadTls(files_, now);
    const std::string before =
        std::exchange(wrong_, material.ok() ? "" : std::string(material.status().message()));
    const bool first = current_.material == nullptr;
    if (material.ok()) {
      current_.material = std::make_shared<const TlsMaterial>(*std::move(material));
      ++current_.generation;
      warned_ = false;
      if (log_ != nullptr && !first) {
        log_->Info("TLS files were read again", {{"certificate", files_.certificate}});
      }
    } else {
      ++refused_;
      if (log_ != nullptr && !first && wrong_ != before) {
        log_->Error("TLS files are wrong: the last that were right stay in force",
                    {{"why", wrong_}});
      }
    }
  }
  if (!wrong_.empty()) return absl::FailedPreconditionError(wrong_);
  if (current_.material->expires_s - kWarnSeconds <= now && !std::exchange(warned_, true) &&
      log_ != nullptr) {
    log_->Warn("the daemon's certificate expires soon",
               {{"certificate", files_.certificate},
                {"seconds", absl::StrCat(current_.material->expires_s - now)}});
  }
  return absl::OkStatus();
}

TlsStore::Current TlsStore::current() const {
  sync::MutexLock lock(mutex_);
  return current_;
}

TlsStore::Counts TlsStore::counts() const {
  sync::MutexLock lock(mutex_);
  return {.taken = current_.generation, .refused = refused_};
}

std::string TlsStore::trouble() const {
  const int64_t now = now_();
  sync::MutexLock lock(mutex_);
  if (!wrong_.empty()) return wrong_;
  const int64_t left = current_.material->expires_s - now;
  if (left > kWarnSeconds) return "";
  if (left <= 0) return absl::StrCat("the certificate in ", files_.certificate, " has expired");
  return absl::StrCat("the certificate in ", files_.certificate, " expires in ", left / 3600,
                      " hours");
}

}  // namespace voxeld::daemon::access
