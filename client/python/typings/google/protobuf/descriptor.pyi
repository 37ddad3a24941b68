class Descriptor:
    full_name: str

class FieldDescriptor:
    name: str

class FileDescriptor:
    name: str
