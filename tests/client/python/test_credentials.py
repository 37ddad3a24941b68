import os
import tempfile
import unittest

import voxeld
from voxeld import Credentials, InvalidValue, address, credentials


class Environment(unittest.TestCase):
    def test_every_field_has_its_variable(self) -> None:
        self.assertEqual(Credentials.from_environment({}), Credentials())
        self.assertEqual(
            Credentials.from_environment({"VOXELD_TOKEN": "a", "VOXELD_TOKEN_FILE": "b", "VOXELD_TLS_CA": "c",
                                          "VOXELD_TLS_CERT": "d", "VOXELD_TLS_KEY": "e", "VOXELD_TLS_NAME": "f"}),
            Credentials("a", "b", "c", "d", "e", "f"))


class Token(unittest.TestCase):
    def test_it_goes_with_every_call_where_nobody_else_can_read_it(self) -> None:
        for server in ("unix:/a", "127.0.0.1:1", "[::1]:1", "localhost:1", "tls:10.0.0.1:1", "tls:host:1"):
            self.assertEqual(credentials.metadata(server, Credentials("secret")), (("authorization", "Bearer secret"),))
        for server in ("10.0.0.1:1", "host:1", "[2001:db8::1]:1"):
            self.assertEqual(credentials.metadata(server, Credentials()), ())
            with self.assertRaisesRegex(InvalidValue, f"give tls:"):
                credentials.metadata(server, Credentials("secret"))

    def test_a_file_has_it_and_its_last_line_ends(self) -> None:
        with tempfile.NamedTemporaryFile("w") as file:
            file.write("secret\n")
            file.flush()
            self.assertEqual(credentials.metadata("unix:/a", Credentials(token_file=file.name)),
                             (("authorization", "Bearer secret"),))
        with self.assertRaisesRegex(InvalidValue, "No such file"):
            credentials.metadata("unix:/a", Credentials(token_file=file.name))

    def test_what_is_no_token_is_said(self) -> None:
        for token in ("a b", "a\nb", "\u00e9"):
            with self.assertRaisesRegex(InvalidValue, "the token has"):
                credentials.metadata("unix:/a", Credentials(token))


class Tls(unittest.TestCase):
    def test_addresses(self) -> None:
        self.assertEqual(address.target("tls:host:1"), "dns:///host:1")
        self.assertTrue(address.is_tls("tls:host:1"))
        self.assertFalse(address.is_tls("host:1"))

    def test_files_that_are_not_there_are_said_before_anything_is_tried(self) -> None:
        missing = os.path.join(tempfile.gettempdir(), "no-such-file.pem")
        with self.assertRaisesRegex(InvalidValue, "ca .*no-such-file.pem.* cannot be read"):
            voxeld.connect("tls:127.0.0.1:1", credentials=Credentials(ca=missing), wait=False)
        with self.assertRaisesRegex(InvalidValue, "give both, or none"):
            voxeld.connect("tls:127.0.0.1:1", credentials=Credentials(key=missing), wait=False)


if __name__ == "__main__":
    unittest.main()
