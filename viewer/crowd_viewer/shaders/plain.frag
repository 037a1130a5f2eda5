out uint number;

void main() {
    number = 0u;
}
