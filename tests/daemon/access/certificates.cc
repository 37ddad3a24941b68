#include "tests/daemon/access/certificates.h"

#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <fstream>

namespace voxeld::daemon::access {
namespace {

int next_serial = 1;

template <typename Write>
std::string Pem(Write write) {
  BIO* bio = BIO_new(BIO_s_mem());
  write(bio);
  char* text = nullptr;
  const long size = BIO_get_mem_data(bio, &text);
  std::string out(text, static_cast<size_t>(size));
  BIO_free(bio);
  return out;
}

std::string PemOf(X509* certificate) {
  return Pem([&](BIO* bio) { PEM_write_bio_X509(bio, certificate); });
}

void Extend(X509* certificate, X509* issuer, int what, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, what, value);
  ASSERT_NE(extension, nullptr);
  X509_add_ext(certificate, extension, -1);
  X509_EXTENSION_free(extension);
}

X509* NewCertificate(const std::string& name, EVP_PKEY* key, int64_t from_s, int64_t until_s) {
  X509* out = X509_new();
  X509_set_version(out, 2);
  ASN1_INTEGER_set(X509_get_serialNumber(out), next_serial++);
  X509_gmtime_adj(X509_getm_notBefore(out), from_s);
  X509_gmtime_adj(X509_getm_notAfter(out), until_s);
  X509_set_pubkey(out, key);
  if (!name.empty()) {
    X509_NAME_add_entry_by_txt(X509_get_subject_name(out), "CN", MBSTRING_UTF8,
                               reinterpret_cast<const unsigned char*>(name.data()),
                               static_cast<int>(name.size()), -1, 0);
  }
  return out;
}

}  // namespace

struct TestAuthority::Keys {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  X509* certificate = nullptr;
  ~Keys() {
    X509_free(certificate);
    EVP_PKEY_free(key);
  }
};

TestAuthority::TestAuthority(const std::string& name) : keys_(std::make_unique<Keys>()) {
  keys_->certificate = NewCertificate(name, keys_->key, -86400, 86400);
  X509_set_issuer_name(keys_->certificate, X509_get_subject_name(keys_->certificate));
  Extend(keys_->certificate, keys_->certificate, NID_basic_constraints, "critical,CA:TRUE");
  X509_sign(keys_->certificate, keys_->key, EVP_sha256());
  certificate_ = PemOf(keys_->certificate);
}

TestAuthority::~TestAuthority() = default;

Issued TestAuthority::Issue(const std::string& name, int64_t from_s, int64_t until_s) {
  return Issue(name, name, from_s, until_s);
}

Issued TestAuthority::IssueWithoutSubject(const std::string& name) {
  return Issue("", name, -3600, 3600);
}

Issued TestAuthority::Issue(const std::string& subject, const std::string& name, int64_t from_s,
                            int64_t until_s) {
  EVP_PKEY* key = EVP_EC_gen("P-256");
  X509* certificate = NewCertificate(subject, key, from_s, until_s);
  X509_set_issuer_name(certificate, X509_get_subject_name(keys_->certificate));
  Extend(certificate, keys_->certificate, NID_subject_alt_name,
         ("DNS:" + name + ",IP:127.0.0.1").c_str());
  X509_sign(certificate, keys_->key, EVP_sha256());
  Issued issued{PemOf(certificate), Pem([&](BIO* bio) {
                  PEM_write_bio_PrivateKey(bio, key, nullptr, nullptr, 0, nullptr, nullptr);
                })};
  X509_free(certificate);
  EVP_PKEY_free(key);
  return issued;
}

void PutFile(const std::string& path, const std::string& text, unsigned mode) {
  const std::string beside = path + ".new";
  {
    std::ofstream file(beside, std::ios::binary | std::ios::trunc);
    file << text;
    ASSERT_TRUE(file.good());
  }
  ASSERT_EQ(chmod(beside.c_str(), mode), 0);
  ASSERT_EQ(rename(beside.c_str(), path.c_str()), 0);
}

}  // namespace voxeld::daemon::access
